"""Tumbling delivery drone with gravity, thrust and rotor lag, at constant unequal voltages."""

from pathlib import Path

import numpy as np

from lapwing.dynamics import effects
from lapwing.dynamics.effects._types import Motion
from lapwing.dynamics.integrators import RATES
from lapwing.dynamics.lie.quaternion import exp
from lapwing.dynamics.vehicles import multirotor
from lapwing.dynamics.vehicles.airframe import load_airframe
from lapwing.dynamics.vehicles.multirotor_equations import STANDARD_DENSITY, StepInputs, rate
from lapwing.studies.accuracy.coordinates import of_state
from lapwing.studies.accuracy.integrate import solver_methods
from lapwing.studies.accuracy.problem import Problem
from lapwing.studies.accuracy.reference import DOP853, attitude_rate, dop853

AIRFRAME = Path(__file__).parents[3] / "scenes/vehicles/delivery_drone.toml"
DURATION = 2.0  # [s]
VOLTAGE = (31.0, 32.5, 30.0, 33.0)  # [V] around hover
START = Motion(
    (0.0, 0.0, 50.0), exp((0.2, -0.4, 0.1)), (1.0, 0.5, -0.3), (2.0, -1.5, 1.0), (330.0, 340.0, 320.0, 335.0)
)

RATES[StepInputs] = rate


def problems() -> dict[str, Problem]:
    """Return the problem of this file: the tumbling delivery drone without other effects."""
    u = bare_inputs()
    problem = Problem(
        "delivery drone, bare and tumbling",
        DURATION,
        solver_methods(u, START, DURATION, 16),
        lambda: dop853(lambda t, y: right_hand_side(u, y), of_state(START), DURATION),
        DOP853,
    )
    return {"multirotor": problem}


def bare_inputs() -> StepInputs:
    """Return the drone under gravity and thrust, with its voltages."""
    frame = load_airframe(AIRFRAME)
    p = multirotor.parameters(frame, effects.from_scene({"gravity": {}, "rotor_thrust": {}}, frame))
    return StepInputs(p, p.body, multirotor.initial_state(p).memory, VOLTAGE)


def right_hand_side(u: StepInputs, y: np.ndarray) -> np.ndarray:
    """Return Newton, Euler and a first-order lag for (position, row-major R, velocity, omega, rotor speeds)."""
    layout, body = u.parameters.layout, u.parameters.body
    gravity, rotor = u.parameters.effects
    R, o, speed = y[3:12].reshape(3, 3), y[15:18], y[18:22]
    thrust = rotor.thrust_constant * STANDARD_DENSITY * speed**2
    drag = rotor.torque_constant * STANDARD_DENSITY * speed**2
    place = np.column_stack([layout.x_body, layout.y_body, layout.z_body])
    torque = np.cross(place, np.outer(thrust, (0.0, 0.0, 1.0))).sum(axis=0)
    torque[2] += np.dot(layout.reaction_sign, drag)
    inertia = np.array(body.inertia)
    omega_rate = (torque - np.cross(o, inertia * o)) / inertia
    acceleration = R[:, 2] * thrust.sum() / body.mass - [0.0, 0.0, gravity.acceleration]
    lag = layout.lag_rate * (np.array(u.voltage) * layout.speed_per_volt - speed)
    return np.concatenate([y[12:15], attitude_rate(y[3:12], o), acceleration, omega_rate, lag])
