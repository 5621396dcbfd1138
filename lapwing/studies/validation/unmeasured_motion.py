"""Flights without position, velocity or attitude: what gyroscope, accelerometer and motor commands alone determine.

Rate and specific force in body axes depend on the motor commands and the rate, hardly on the rest of the motion. So the
windows start with made-up values of the missing quantities, at rest, and only measured signals are compared.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from lapwing.flights.log_import.recording import Recording
from lapwing.flights.rotation_arrays import from_vector, product
from lapwing.studies.validation.start_states import TrimMemory

TORQUE_MEMORY = 0.3  # [s] of the trim, which then contains the moment of the drag at the unknown velocity
HEIGHT = 10.0  # [m] made up, clear of the ground
ALOFT = 0.5  # share of the median motor voltage below which the vehicle may stand on the ground
MASS, DRAG, TORQUE = (
    "mass: only thrust over mass follows from the accelerometer",
    "drag: the velocity is not measured",
    "inertia and torque constant: only the ratio to thrust over mass, and of both about z",
)


def unmeasured_motion(flights: Sequence[Recording]) -> tuple[str, ...]:
    """Return which of position, velocity and attitude cannot be compared.

    Empty if a flight has all of them: others are left out. Without an attitude, predictions in the world have no axes.
    """
    if any(not flight.missing for flight in flights):
        return ()
    missing = {name for flight in flights for name in flight.missing}
    return tuple(n for n in ("position", "velocity", "attitude") if n in missing or "attitude" in missing)


def with_made_up_motion(flight: Recording, unmeasured: Sequence[str]) -> Recording:
    """Return a flight in the air with made-up values of some quantities: at rest, and the attitude of the gyroscope."""
    if not unmeasured:
        return flight
    n = len(flight)
    made_up: dict[str, Any] = {"position": np.tile([0.0, 0.0, HEIGHT], (n, 1)), "velocity": np.zeros((n, 3))}
    if "attitude" in unmeasured:
        turn = from_vector(np.nan_to_num(flight.omega) * flight.interval)
        made_up["attitude"] = np.tile([1.0, 0.0, 0.0, 0.0], (n, 1))
        for k in range(1, n):
            made_up["attitude"][k] = product(made_up["attitude"][k - 1], turn[k - 1])
    mean = flight.motor_voltage.mean(axis=1)
    running = mean > ALOFT * np.median(mean[mean > 0.0]) if (mean > 0.0).any() else np.zeros(n, bool)
    return replace(flight, **{name: made_up[name] for name in unmeasured}, valid=flight.valid & running)


def trim_memory(memory: TrimMemory, unmeasured: Sequence[str]) -> TrimMemory:
    """Return the time constants of the trim: residual forces need a velocity."""
    return TrimMemory(0.0, min(memory.torque, TORQUE_MEMORY)) if "velocity" in unmeasured else memory


def unknown_parameters(flights: Sequence[Recording], unmeasured: Sequence[str]) -> tuple[str, ...]:
    """Return what such flights do not determine, a line each."""
    if not unmeasured:
        return ()
    has_force = any(np.isfinite(flight.specific_force).any() for flight in flights)
    mass = MASS if has_force or "velocity" not in unmeasured else "thrust over mass: there is no accelerometer"
    return (mass, *((DRAG,) if "velocity" in unmeasured else ()), TORQUE)
