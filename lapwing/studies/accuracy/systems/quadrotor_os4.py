"""OS4 quadrotor: experiments 1 to 4, three seconds from rest at constant rotor speeds."""

import math

import numpy as np

from lapwing.dynamics.lie.quaternion import NO_ROTATION
from lapwing.papers.quadrotor_os4 import Os4Parameters, Os4State
from lapwing.studies.accuracy.coordinates import of_state
from lapwing.studies.accuracy.integrate import solver_methods
from lapwing.studies.accuracy.problem import Problem
from lapwing.studies.accuracy.reference import DOP853, attitude_rate, dop853

DURATION = 3.0  # [s]
STILL = (0.0, 0.0, 0.0)
OS4 = Os4Parameters(
    mass=0.650,
    inertia=(7.5e-3, 7.5e-3, 1.3e-2),
    arm=0.23,
    lift_constant=3.13e-5,
    drag_constant=7.5e-7,
    rotor_inertia=6.0e-5,
    gravity=9.81,
    translational_drag=(0.1, 0.1, 0.1),
)
EXPERIMENTS_RPM = {
    1: (2155, 2155, 2155, 2155),
    2: (2155, 2154, 2155, 2156),
    3: (2154, 2155, 2156, 2155),
    4: (2154, 2154, 2156, 2156),
}


def problems() -> dict[str, Problem]:
    """Return the problems of this file, one for each experiment of the source."""
    return {f"os4_experiment_{number}": _problem(number, rpm) for number, rpm in EXPERIMENTS_RPM.items()}


def _problem(number: int, rpm: tuple[int, ...]) -> Problem:
    speed = tuple(r * math.pi / 30.0 for r in rpm)
    start = Os4State(STILL, NO_ROTATION, STILL, STILL, speed)  # type: ignore[arg-type]
    return Problem(
        f"OS4 quadrotor: experiment {number}",
        DURATION,
        solver_methods(OS4, start, DURATION, 8),
        lambda: dop853(lambda t, y: right_hand_side(OS4, y), of_state(start), DURATION),
        DOP853,
    )


def right_hand_side(p: Os4Parameters, y: np.ndarray) -> np.ndarray:
    """Return Newton and Euler for (position, row-major R, velocity, omega, rotor speeds), summed rotor by rotor."""
    R, v, o, speed = y[3:12].reshape(3, 3), y[12:15], y[15:18], y[18:22]
    place = p.arm * np.array([[1.0, 0, 0], [0, 1.0, 0], [-1.0, 0, 0], [0, -1.0, 0]])
    clockwise = np.array([1.0, -1.0, 1.0, -1.0])  # seen from above; drag turns the body in the opposite direction
    thrust = p.lift_constant * speed**2
    torque = np.cross(place, np.outer(thrust, (0.0, 0.0, 1.0))).sum(axis=0)
    torque[2] += (clockwise * p.drag_constant * speed**2).sum()
    rotors = np.array([0.0, 0.0, -p.rotor_inertia * (clockwise * speed).sum()])
    inertia = np.array(p.inertia)
    omega_rate = (torque - np.cross(o, inertia * o + rotors)) / inertia
    acceleration = (
        R[:, 2] * thrust.sum() / p.mass - np.multiply(p.translational_drag, v) / p.mass - [0.0, 0.0, p.gravity]
    )
    return np.concatenate([v, attitude_rate(y[3:12], o), acceleration, omega_rate, np.zeros(4)])
