"""Cases of free rigid bodies for simulators with fixed steps."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from benchmarks.other_simulators.stability import Errors
from lapwing.studies.stability.cases import intermediate_axis, looping, odd_inertia
from lapwing.studies.stability.sampled_runs import drift

# (inertia [kg m^2], start, duration [s], steps, samples) -> R_world_body and omega_body, shape (samples + 1, 12)
March = Callable[[Any, Any, float, int, int], np.ndarray]


def cases(methods: Mapping[str, March]) -> dict[str, Callable[[], Errors]]:
    """Return the `CASES` of free bodies for methods by their displayed names."""

    def tumbling() -> Errors:
        c = intermediate_axis
        result: dict[str, dict[str, float]] = {"rates": {}, "energy": {}, "momentum": {}}
        for name, march in methods.items():
            y = march(c.INERTIA, c.initial_state(c.EPSILON), c.DURATION, c.STEPS, c.SAMPLES)
            for row, values in zip(result, c.figures_of_run(y, c.EPSILON), strict=True):
                result[row][name] = float(values.max())
        return result

    def loops() -> Errors:
        c = looping
        return {
            "momentum": {
                name: float(
                    drift(c.momentum(march(c.INERTIA, c.initial_state(c.OFFSET), c.DURATION, c.STEPS, c.SAMPLES))).max()
                )
                for name, march in methods.items()
            }
        }

    def odd_bodies() -> Errors:
        c = odd_inertia
        return {
            body: {
                name: float(
                    c.drifts_of_run(
                        march(inertia, c.RigidBody(c.ATTITUDE, omega), c.DURATION, c.STEPS, c.SAMPLES), inertia
                    ).max()
                )
                for name, march in methods.items()
            }
            for body, (inertia, omega) in c.BODIES.items()
        }

    return {"intermediate_axis": tumbling, "looping": loops, "odd_inertia": odd_bodies}
