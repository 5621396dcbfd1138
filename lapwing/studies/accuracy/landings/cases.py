"""Landings drawn at random, flown by the plant, and their errors against the reference."""

import math
import time
from pathlib import Path
from typing import NamedTuple

import numpy as np

import lapwing.scenes
from lapwing.dynamics import effects, integrators
from lapwing.dynamics.effects._contact_parameters import GroundContact
from lapwing.dynamics.environment import Environment
from lapwing.dynamics.lie.quaternion import Quaternion, exp, multiply
from lapwing.dynamics.terrain import relief
from lapwing.dynamics.vehicles import multirotor
from lapwing.dynamics.vehicles.airframe import load_airframe
from lapwing.dynamics.vehicles.multirotor_equations import STANDARD_DENSITY, MultirotorParameters, MultirotorState
from lapwing.kernels.state_tree import flatten
from lapwing.services.plant.schema import CONTACT_SHARE
from lapwing.studies.accuracy.coordinates import coordinates, of_state
from lapwing.studies.accuracy.landings.reference import LandingBody, LandingGround, landing

AIRFRAME = Path(lapwing.scenes.__file__).parent / "vehicles/delivery_drone.toml"
DURATION, INTERVAL = 0.6, 0.004  # [s] flown, and between the moments that are compared
STEP = 1e-3  # [s]
ACCURACIES = tuple(10.0**-k for k in range(3, 10))
GRAVITY = 9.80665
CLEAR = 2e-3  # [m] the lowest point is above the ground at first
WAVE = 2.0 * math.pi / 0.7  # [1/m] of bumps


class Landing(NamedTuple):
    """Initial conditions of a landing."""

    slope: tuple[float, float]  # rise of the ground along x and y
    bump: float  # [m]
    speed: float  # [m/s] down
    slip: tuple[float, float]  # [m/s] world x and y
    tilt: tuple[float, float, float]  # [rad] rotation vector from upright over the slope
    heading: float  # [rad]
    spin: tuple[float, float, float]  # [rad/s] in the body
    rotor_speed: float  # [rad/s], slowing down


def draw(seed: int) -> Landing:
    """Draw a landing: speed 0-3 m/s, slip 0-2 m/s, tilt 0-30 degrees, slope 0-20 degrees, spin to 1 rad/s an axis.

    Every fourth is on bumps of 1 cm.
    """
    rng = np.random.default_rng([33, seed])
    steep, along = math.tan(math.radians(rng.uniform(0.0, 20.0))), rng.uniform(0.0, 2.0 * math.pi)
    slip, to = rng.uniform(0.0, 2.0), rng.uniform(0.0, 2.0 * math.pi)
    tilt, about = math.radians(rng.uniform(0.0, 30.0)), rng.uniform(0.0, 2.0 * math.pi)
    speed, heading = float(rng.uniform(0.0, 3.0)), float(rng.uniform(0.0, 2.0 * math.pi))
    roll, pitch, yaw = map(float, rng.uniform(-1.0, 1.0, 3))
    return Landing(
        (steep * math.cos(along), steep * math.sin(along)),
        0.01 if seed % 4 == 3 else 0.0,
        speed,
        (slip * math.cos(to), slip * math.sin(to)),
        (tilt * math.cos(about), tilt * math.sin(about), 0.0),
        heading,
        (roll, pitch, yaw),
        float(rng.uniform(0.0, 300.0)),
    )


def plant(case: Landing) -> tuple[MultirotorParameters, MultirotorState]:
    """Return the plant's parameters and its state above the ground."""
    frame = load_airframe(AIRFRAME)
    terrain = relief(case.slope, bump_height=case.bump, bump_length=2.0 * math.pi / WAVE)
    tables: dict[str, dict] = {"gravity": {}, "ground_contact": {}, "rotor_thrust": {}}
    p = multirotor.parameters(frame, effects.from_scene(tables, frame, Environment(terrain=terrain)))
    attitude = multiply(exp((0.0, 0.0, case.heading)), exp(case.tilt))
    matrix = of_state(Quaternion(*attitude)).reshape(3, 3)
    points = np.array(contact_of(p).feet) @ matrix.T
    clear = max(case.slope[0] * x + case.slope[1] * y - z for x, y, z in points) + case.bump + CLEAR
    state = multirotor.initial_state(
        p, (0.0, 0.0, float(clear)), attitude, case.rotor_speed, (*case.slip, -case.speed), case.spin
    )
    return p, state


def contact_of(p: MultirotorParameters) -> GroundContact:
    """Return the contact of a plant."""
    return next(e for e in p.effects if isinstance(e, GroundContact))


def exact(case: Landing, tolerance: float = 1e-13) -> tuple[np.ndarray, int]:
    """Return (states at the moments compared by the reference, shape (k, 22), number of its events)."""
    p, state = plant(case)
    e, layout = contact_of(p), p.layout
    rotor = next(x for x in p.effects if hasattr(x, "thrust_constant"))
    body = LandingBody(
        p.body.mass, np.array(p.body.inertia), np.array(e.feet),
        np.column_stack([layout.x_body, layout.y_body, layout.z_body]), np.array(layout.reaction_sign),
        rotor.thrust_constant * STANDARD_DENSITY, rotor.torque_constant * STANDARD_DENSITY, layout.lag_rate, GRAVITY,
    )  # fmt: skip
    ground = LandingGround(
        case.slope, case.bump, WAVE, e.stiffness, e.damping, 1.0 / e.inverse_width, e.static, e.dynamic,
        e.tangential_stiffness, e.tangential_damping, 1.0 / e.inverse_stiction,
    )  # fmt: skip
    start = np.concatenate([of_state(state.motion), np.zeros(3 * len(e.feet))])
    states, events = landing(body, ground, start, times(), tolerance)
    return states[:, : len(start) - 3 * len(e.feet)], events


def times() -> np.ndarray:
    """Return the moments [s] that are compared."""
    return np.arange(round(DURATION / INTERVAL) + 1) * INTERVAL


def flown(case: Landing, accuracy: float, integrator: str = "rk4_renormalised") -> tuple[np.ndarray, float]:
    """Return (states of the plant at the same moments, wall time [s])."""
    p, state = plant(case)
    p = p._replace(tolerance=CONTACT_SHARE * accuracy)
    method, n = integrators.get(integrator).Method(), round(INTERVAL / STEP)
    off = (0.0,) * len(p.layout.x_body)
    rows, began = [state.motion], time.perf_counter()
    for tick in range(len(times()) - 1):
        state = multirotor.advance(method, p, (0, 0), tick, state, off, STEP, n)
        rows.append(state.motion)
    seconds = time.perf_counter() - began
    return coordinates(state.motion, np.array([flatten(m) for m in rows])), seconds


def errors(states: np.ndarray, reference: np.ndarray) -> np.ndarray:
    """Return the largest error at each moment, of all numbers of the state relative to 1 + their size."""
    return (np.abs(states - reference) / (1.0 + np.abs(reference))).max(axis=1)
