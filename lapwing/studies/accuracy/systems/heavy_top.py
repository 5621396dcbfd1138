"""Heavy top: a rigid body on a pivot under its weight."""

import math
from typing import NamedTuple

import numpy as np

from lapwing.dynamics.integrators import RATES
from lapwing.dynamics.lie.quaternion import exp, rotate_back
from lapwing.dynamics.vector import Vec3, add, cross, divide, multiply
from lapwing.dynamics.vehicles.rigid_body import RigidBody
from lapwing.kernels import always_inline
from lapwing.studies.accuracy.coordinates import of_state
from lapwing.studies.accuracy.integrate import solver_methods
from lapwing.studies.accuracy.problem import Problem
from lapwing.studies.accuracy.reference import DOP853, attitude_rate, dop853, to_world

MASS, GRAVITY = 1.0, 9.81  # [kg], [m/s^2]
ARM = 0.2  # [m] from the pivot to the centre of mass, along body x
CENTRAL_INERTIA = (0.01, 0.008, 0.009)  # [kg m^2] about the centre of mass
INERTIA = (0.01, 0.048, 0.049)  # [kg m^2] about the pivot, MASS ARM^2 larger across the arm
START = RigidBody(exp((0.0, math.radians(-30.0), 0.0)), (80.0, 0.5, 0.8))  # the arm 30 degrees above level
DURATION = 5.0  # [s]


class HeavyTopParameters(NamedTuple):
    """Parameters of a rigid body on a pivot under its weight."""

    inertia: Vec3  # [kg m^2] about the pivot, principal moments
    arm_body: Vec3  # [m] from the pivot to the centre of mass
    weight_world: Vec3  # [N]

    @property
    def torque_without_rate(self) -> bool:
        """True: the torque does not depend on the angular velocity."""
        return True


@always_inline
def rate(p: HeavyTopParameters, t: float, x: RigidBody) -> RigidBody:
    """Return the tangent: I omega' = I omega x omega + r x R^T weight."""
    o = x.omega_body
    torque = cross(p.arm_body, rotate_back(x.attitude, p.weight_world))
    return RigidBody(o, divide(add(cross(multiply(p.inertia, o), o), torque), p.inertia))  # type: ignore[arg-type]


RATES[HeavyTopParameters] = rate


def problems() -> dict[str, Problem]:
    """Return the problem of this file: a heavy top that spins about its arm and nutates."""
    p = HeavyTopParameters(INERTIA, (ARM, 0.0, 0.0), (0.0, 0.0, -MASS * GRAVITY))
    problem = Problem(
        "heavy top, spinning and nutating",
        DURATION,
        solver_methods(p, START, DURATION, 128),
        lambda: dop853(right_hand_side, of_state(START), DURATION),
        DOP853,
        {"energy": energy, "vertical momentum": vertical_momentum},
    )
    return {"heavy_top": problem}


def right_hand_side(t: float, y: np.ndarray) -> np.ndarray:
    """Return the momentum balance about the pivot in the world, for row-major R and omega in the body."""
    R, o = y[:9].reshape(3, 3), y[9:]
    torque_world = np.cross(ARM * R[:, 0], [0.0, 0.0, -MASS * GRAVITY])
    omega_rate = (R.T @ torque_world - np.cross(o, np.multiply(INERTIA, o))) / INERTIA
    return np.concatenate([attitude_rate(y[:9], o), omega_rate])


def energy(t: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return the kinetic and potential energy [J], shape (k,)."""
    return 0.5 * (y[:, 9:] ** 2 * INERTIA).sum(axis=1) + MASS * GRAVITY * ARM * y[:, 6]


def vertical_momentum(t: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return the angular momentum about the vertical through the pivot [N m s], shape (k,)."""
    return to_world(y[:, :9], y[:, 9:] * INERTIA)[:, 2]
