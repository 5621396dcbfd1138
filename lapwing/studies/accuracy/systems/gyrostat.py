"""Gyrostat satellite in four cases, with a variant for rotors at constant speed."""

import numpy as np

from lapwing.dynamics.lie.quaternion import NO_ROTATION
from lapwing.dynamics.vehicles.rigid_body import RigidBody
from lapwing.papers.gyrostat import GyrostatParameters
from lapwing.studies.accuracy.coordinates import of_state
from lapwing.studies.accuracy.integrate import solver_methods
from lapwing.studies.accuracy.problem import Problem
from lapwing.studies.accuracy.reference import DOP853, attitude_rate, dop853, to_world

DURATION = 60.0  # [min], the unit of Ge and Lin's numbers
START = RigidBody(NO_ROTATION, (0.1, 0.1, 0.1))  # [rad/min]
NONE, ONE = (0.0, 0.0, 0.0), (1.0, 1.0, 1.0)

FEEDBACK = GyrostatParameters(
    inertia=(500.0, 500.0, 1000.0),
    rotor_momentum=(200.0, 200.0, 250.0),
    forcing_amplitude=4.5,
    forcing_frequency=1.0,
    damping=200.0,
    linear_gain=ONE,
    cubic_gain=ONE,
    desired_rate=0.0,
    attitude_gain=0.0,
    rate_gain=0.0,
    target=NO_ROTATION,
)
FRICTION = FEEDBACK._replace(linear_gain=NONE, cubic_gain=NONE)
SPINNING = FRICTION._replace(damping=0.0)
STEADY = SPINNING._replace(forcing_amplitude=0.0, inertia=(500.0, 550.0, 1000.0))  # three different moments
BLOCKED = SPINNING._replace(rotor_momentum=NONE)


def problems() -> dict[str, Problem]:
    """Return this file's problems: a satellite with rotors blocked, spinning, under friction, and under feedback."""
    momentum = {"momentum": lambda t, y: total_momentum(SPINNING, t, y)}
    steady = {"energy": lambda t, y: energy(STEADY, t, y), "momentum": lambda t, y: total_momentum(STEADY, t, y)}
    free = {"energy": lambda t, y: energy(BLOCKED, t, y), "momentum": lambda t, y: total_momentum(BLOCKED, t, y)}
    cases = {
        "blocked": (BLOCKED, "rotors blocked", free),
        "steady": (STEADY, "rotors spinning evenly", steady),
        "spinning": (SPINNING, "rotors spinning, the third unevenly", momentum),
        "friction": (FRICTION, "friction about the third axis", {}),
        "feedback": (FEEDBACK, "friction, and feedback of the rates", {}),
    }
    return {f"gyrostat_{name}": _problem(p, title, invariants) for name, (p, title, invariants) in cases.items()}


def _problem(p: GyrostatParameters, title: str, invariants: dict) -> Problem:
    return Problem(
        f"gyrostat satellite: {title}",
        DURATION,
        solver_methods(p, START, DURATION, 32),
        lambda: dop853(lambda t, y: right_hand_side(p, t, y), of_state(START), DURATION),
        DOP853,
        invariants,
        unit="min",
    )


def right_hand_side(p: GyrostatParameters, t: float, y: np.ndarray) -> np.ndarray:
    """Return Ge and Lin's scalar equations for (x, y, z), and R' = R hat(omega); y is row-major R and omega."""
    a, b, c = p.inertia
    h1, h2, h3 = p.rotor_momentum
    u, v, w = y[9:]
    f, frequency, g = p.forcing_amplitude, p.forcing_frequency, p.desired_rate
    spin = h3 * (1.0 + f * np.cos(frequency * t))
    back = [k * (g - o) + q * (g - o) ** 3 for k, q, o in zip(p.linear_gain, p.cubic_gain, (u, v, w), strict=True)]
    du = ((b - c) * v * w - spin * v + h2 * w + back[0]) / a
    dv = ((c - a) * u * w - h1 * w + spin * u + back[1]) / b
    forcing = h3 * f * frequency * np.sin(frequency * t)
    dw = ((a - b) * u * v - h2 * u + h1 * v + forcing - p.damping * w + back[2]) / c
    return np.concatenate([attitude_rate(y[:9], y[9:]), [du, dv, dw]])


def energy(p: GyrostatParameters, t: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return the kinetic energy of the platform, shape (k,)."""
    return 0.5 * (y[:, 9:] ** 2 * p.inertia).sum(axis=1)


def total_momentum(p: GyrostatParameters, t: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return the momentum of platform and rotors in the world, shape (k, 3) (theory, eq. (7.8))."""
    h = np.tile(p.rotor_momentum, (len(t), 1)).astype(float)
    h[:, 2] *= 1.0 + p.forcing_amplitude * np.cos(p.forcing_frequency * t)
    return to_world(y[:, :9], y[:, 9:] * p.inertia + h)
