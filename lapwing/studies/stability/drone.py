"""Delivery drone of five bodies in free rotation, and its hinge defects, for several cases."""

from typing import Any

import numpy as np

from lapwing.dynamics import integrators
from lapwing.dynamics.lie.quaternion import NO_ROTATION
from lapwing.dynamics.multibody.delivery_drone import delivery_drone
from lapwing.dynamics.multibody.five_bodies import BodyState, machine
from lapwing.dynamics.multibody.five_body_stabilisation import (
    NONE,
    PARTITION,
    PROJECTION,
    advance,
    assembled_state,
    constraint_violation,
)
from lapwing.dynamics.vector import ZERO, Vec3

__all__ = ["METHOD", "PAPER", "STABILISATIONS", "delivery_drone", "hinge_defects", "spinning_state"]

METHOD = integrators.get("rk4_renormalised").Method()
STABILISATIONS = {"projection": PROJECTION, "partitioning": PARTITION, "none": NONE}

PAPER: dict[str, Any] = {
    "central_frame": 8.0,
    "payload": 2.0,
    "frame_inertia": (0.27, 0.26, 0.42),
    "propeller": 5.6e-3,
    "propeller_inertia": (9.8e-6, 8.6e-4, 8.6e-4),
    "arm_length": 0.4974,
    "rotor_sign_x": (1, -1, -1, 1),
    "rotor_sign_y": (1, 1, -1, -1),
}


def spinning_state(drone: Any, omega: Vec3, speeds: tuple[float, ...]) -> tuple[Any, Any]:
    """Return (machine, state) rotating at omega [rad/s] with propellers at these speeds [rad/s], without loads."""
    p = machine(drone, ZERO, speeds=speeds)
    return p, assembled_state(p, BodyState(ZERO, NO_ROTATION, ZERO, omega), (0.1, 0.4, 0.7, 1.0), speeds)


def hinge_defects(p: Any, x: Any, stabilisation: int, step: float, every: int, samples: int) -> np.ndarray:
    """Return the largest position or velocity defect [m, -, m/s, rad/s] after each `every` steps, shape (samples,)."""
    result = []
    for sample in range(samples):
        x = advance(METHOD, p, sample * every * step, x, step, every, stabilisation)
        result.append(max(constraint_violation(p, x)))
    return np.array(result)
