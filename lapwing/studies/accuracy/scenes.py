"""Scenes as problems: the plant of a scene, with steps that divide the communication step."""

from typing import Any

import numpy as np

from lapwing.cosim.scene import Scene
from lapwing.dynamics.integrators import get
from lapwing.kernels.state_tree import flatten
from lapwing.papers.cooperative_load.cooperative_load import CooperativeLoadParameters, LiftCommand
from lapwing.services.common.schemas.communication_schema import Communication
from lapwing.services.common.schemas.run_schema import Run
from lapwing.services.common.schemas.vehicle_schema import Vehicle
from lapwing.studies.accuracy import plant
from lapwing.studies.accuracy.coordinates import coordinates
from lapwing.studies.accuracy.integrate import SAMPLES, fixed_step_methods, sample_states
from lapwing.studies.accuracy.problem import Problem

FINEST = 64  # steps of the reference per communication step


def problem(scene: Scene) -> Problem:
    """Return the problem on which integrators are compared for a scene.

    Raises:
        ValueError: the study does not support the scene's model.
    """
    return manoeuvres(scene)[0]


def manoeuvres(scene: Scene) -> list[Problem]:
    """Return the problems for the selection of a solver; the first one is that of `problem`.

    Raises:
        ValueError: see `problem`.
    """
    if hasattr(plant.model(scene), "describe"):
        return [plant.problem(scene, manoeuvre) for manoeuvre in plant.MANOEUVRES]
    return [_fixed_step_problem(scene, *physics(scene))]


def physics(scene: Scene) -> tuple[Any, Any]:
    """Return (parameters, initial state) of the scene's plant.

    Raises:
        ValueError: this study does not support the plant's model.
    """
    model = plant.model(scene)
    if hasattr(model, "describe"):
        return plant.physics(scene)
    if not hasattr(model, "system"):
        name = scene[Vehicle].model
        raise ValueError(f"{scene.path}: vehicle.model: the integrators of {name} cannot be compared")
    return model.system(scene)


def _fixed_step_problem(scene: Scene, p: Any, x: Any) -> Problem:
    interval = scene[Communication].interval
    ticks = SAMPLES * max(1, round(scene[Run].duration / interval / SAMPLES))
    p = with_lift(p)

    def reference() -> np.ndarray:
        out = np.empty((2, len(flatten(x))))
        sample_states(get("rkmk54").Method(), p, x, interval / FINEST, FINEST * ticks, out)
        return coordinates(x, out)[-1]

    return Problem(
        f"{scene.name}: its plant",
        ticks * interval,
        fixed_step_methods(p, x, ticks * interval, ticks),
        reference,
        f"rkmk54 with {FINEST} steps per communication step",
    )


def with_lift(p: Any) -> Any:
    """Return the parameters, for a shared load with thrusts that balance the weight and small moments."""
    if not isinstance(p, CooperativeLoadParameters):
        return p
    n = len(p.quad_mass)
    thrust = tuple(p.gravity * (m + p.load_mass / n) for m in p.quad_mass)
    return p._replace(control=LiftCommand(thrust, ((0.01, -0.02, 0.01),) * n))
