"""Random landings, their flights by the plant, and their errors against the reference."""

import math
import time
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import lapwing.scenes
from lapwing.dynamics import effects, integrators
from lapwing.dynamics.constants import STANDARD_GRAVITY
from lapwing.dynamics.effects._contact_parameters import GroundContact
from lapwing.dynamics.environment import Environment
from lapwing.dynamics.lie.quaternion import Quaternion, exp, multiply
from lapwing.dynamics.terrain import relief
from lapwing.dynamics.vector import Vec3, add, scale
from lapwing.dynamics.vehicles import multirotor
from lapwing.dynamics.vehicles.airframe import Airframe, load_airframe
from lapwing.dynamics.vehicles.multirotor_equations import (
    STANDARD_DENSITY,
    MultirotorParameters,
    MultirotorState,
    with_tolerance,
)
from lapwing.kernels.state_tree import flatten
from lapwing.services.plant.schema import contact_tolerance
from lapwing.studies.accuracy.coordinates import coordinates, of_state
from lapwing.studies.accuracy.landings.reference import landing
from lapwing.studies.accuracy.landings.reference_equations import LandingBody, LandingGround
from lapwing.studies.accuracy.solver_selection import IMPACT_SHARE

AIRFRAME = Path(lapwing.scenes.__file__).parent / "vehicles/delivery_drone.toml"
DURATION, INTERVAL = 0.6, 0.004  # [s] of a flight, and between the compared times
ACCURACIES = tuple(10.0**-k for k in range(3, 10))
CLEARANCE = 2e-3  # [m] initial height of the lowest point above the ground
WAVE = 2.0 * math.pi / 0.7  # [1/m] of bumps
MAX_STEPS = 64  # in an interval
NO_STEP = (math.inf, 0.0)
NO_FOLD = (0.0, 1.0)
FOOT = (0.2, 0.25)  # [m] x and y of a front foot in the body
FLANK = 4.0  # [m] least length of the ground on each side of a fold
AIRBORNE_HEIGHT = 50.0  # [m] above the ground, without contact within the duration


class Landing(NamedTuple):
    """Initial conditions of a landing."""

    slope: tuple[float, float]  # rise of the ground along x and y
    bump: float  # [m]
    speed: float  # [m/s] down
    slip: tuple[float, float]  # [m/s] world x and y
    tilt: tuple[float, float, float]  # [rad] rotation vector from upright over the slope
    heading: float  # [rad]
    spin: tuple[float, float, float]  # [rad/s] in the body
    rotor_speed: float  # [rad/s] initial, decaying
    start: float = 0.0  # [m] x of the centre of mass
    step: tuple[float, float] = NO_STEP  # [m] x of the wall; rise
    fold: tuple[float, float] = NO_FOLD  # rise of a grid of heights on both sides of x = 0; [m] spacing of the grid
    tips: bool = False  # True: points of the hull at the propeller tips instead of the hubs


def draw(seed: int) -> Landing:
    """Return a random landing: speed 0-3 m/s, slip 0-2 m/s, tilt to 30 degrees, slope to 20 degrees, spin to 1 rad/s.

    Every fourth landing is on bumps of 1 cm.
    """
    rng = np.random.default_rng([33, seed])
    slope = _random_direction(rng, math.tan(math.radians(rng.uniform(0.0, 20.0))))
    slip = _random_direction(rng, rng.uniform(0.0, 2.0))
    tilt = _random_direction(rng, math.radians(rng.uniform(0.0, 30.0)))
    speed, heading = float(rng.uniform(0.0, 3.0)), float(rng.uniform(0.0, 2.0 * math.pi))
    roll, pitch, yaw = map(float, rng.uniform(-1.0, 1.0, 3))
    bump, rotor_speed = 0.01 if seed % 4 == 3 else 0.0, float(rng.uniform(0.0, 300.0))
    return Landing(slope, bump, speed, slip, (*tilt, 0.0), heading, (roll, pitch, yaw), rotor_speed)


def _random_direction(rng: np.random.Generator, size: float) -> tuple[float, float]:
    """Return a horizontal vector of this length in a random direction."""
    direction = rng.uniform(0.0, 2.0 * math.pi)
    return size * math.cos(direction), size * math.sin(direction)


def draw_step(seed: int) -> Landing:
    """Return a random landing at a step of 5 to 20 cm, into its wall (even seeds) or over its edge (odd seeds)."""
    rng, downwards = np.random.default_rng([34, seed]), seed % 2 == 1
    case, wall = draw(seed), 0.6
    slip = (float(rng.uniform(0.5, 2.0)) * (-1.0 if downwards else 1.0), float(rng.uniform(-0.3, 0.3)))
    start = wall + float(rng.uniform(0.05, 0.3)) * (1.0 if downwards else -1.5)
    return case._replace(
        slope=(0.0, 0.0), bump=0.0, slip=slip, start=start, step=(wall, float(rng.uniform(0.05, 0.2))),
        speed=min(case.speed, 1.0), tilt=scale(0.4, case.tilt),
    )  # fmt: skip


def draw_fold(seed: int) -> Landing:
    """Return a random landing with a foot near a fold of a grid: a valley (even seeds) or a ridge (odd seeds).

    In every other pair of landings two feet are along the fold.
    """
    rng, case = np.random.default_rng([37, seed]), draw(seed)
    rise, spacing = float(rng.uniform(0.1, 0.4)), float(10.0 ** rng.uniform(-1.0, 0.0))
    heading = case.heading if seed % 4 < 2 else 0.0
    foot = FOOT[0] * math.cos(heading) - FOOT[1] * math.sin(heading)  # its x while the vehicle is upright
    return case._replace(
        bump=0.0, heading=heading, start=float(rng.uniform(-0.05, 0.05)) - foot, speed=min(case.speed, 1.0),
        slip=scale(0.2, (*case.slip, 0.0))[:2], tilt=scale(0.4, case.tilt),
        fold=(rise if seed % 2 == 0 else -rise, spacing),
    )  # fmt: skip


def draw_toppling(seed: int) -> Landing:
    """Return a random landing on one or two feet, tilted by 30 to 60 degrees, that turns over onto the hull."""
    rng = np.random.default_rng([35, seed])
    tilt, tilt_direction = math.radians(rng.uniform(30.0, 60.0)), float(rng.uniform(0.0, 2.0 * math.pi))
    axis = (math.cos(tilt_direction), math.sin(tilt_direction), 0.0)
    spin = float(rng.uniform(0.5, 3.0))  # [rad/s] in the direction of the tilt
    x, y, _ = (tilt * part for part in axis)
    return draw(seed)._replace(
        slope=(0.0, 0.0), bump=0.0, speed=float(rng.uniform(0.0, 0.5)), tilt=(x, y, 0.0),
        slip=(float(rng.uniform(-0.5, 0.5)), float(rng.uniform(-0.5, 0.5))),
        spin=(spin * axis[0], spin * axis[1], 0.0),
    )  # fmt: skip


def draw_strike(seed: int) -> Landing:
    """Return a random landing tilted by 40 to 75 degrees, in which a propeller tip strikes before the feet."""
    rng = np.random.default_rng([36, seed])
    tilt = _random_direction(rng, math.radians(rng.uniform(40.0, 75.0)))
    return draw(seed)._replace(
        bump=0.0, speed=float(rng.uniform(0.5, 2.0)), tilt=(*tilt, 0.0),
        slip=(float(rng.uniform(-1.0, 1.0)), float(rng.uniform(-1.0, 1.0))), tips=True,
    )  # fmt: skip


DRAWS: dict[str, Callable[[int], Landing]] = {
    "random": draw, "steps": draw_step, "folds": draw_fold, "toppling": draw_toppling, "strikes": draw_strike,
}  # fmt: skip
# fastest motion after bounces
FASTEST = Landing((0.0, 0.0), 0.0, 3.0, (2.0, 0.0), (0.5, 0.0, 0.0), 0.0, (10.0, 10.0, 10.0), 300.0)


def plant(case: Landing) -> tuple[MultirotorParameters, MultirotorState]:
    """Return the plant's parameters and its state above the ground."""
    frame = load_airframe(AIRFRAME)
    if case.tips:
        frame = _with_tips(frame)
    steps = [case.step] if case.step != NO_STEP else []
    terrain = relief(case.slope, bump_height=case.bump, bump_length=2.0 * math.pi / WAVE, steps=steps, **_grid(case))
    tables: dict[str, dict] = {"gravity": {}, "ground_contact": {}, "rotor_thrust": {}}
    p = multirotor.parameters(frame, effects.from_scene(tables, frame, Environment(terrain=terrain)))
    attitude = multiply(exp((0.0, 0.0, case.heading)), exp(case.tilt))
    matrix = of_state(Quaternion(*attitude)).reshape(3, 3)
    points = np.array(contact_of(p).feet) @ matrix.T
    edge, rise = case.step
    ground = (
        case.slope[0] * (case.start + x) + case.slope[1] * y + (rise if case.start + x > edge else 0.0)
        + max(0.0, case.fold[0]) * abs(case.start + x)
        for x, y, _ in points
    )  # fmt: skip
    clearance = max(height - z for height, (_, _, z) in zip(ground, points, strict=True)) + case.bump + CLEARANCE
    state = multirotor.initial_state(
        p, (case.start, 0.0, float(clearance)), attitude, case.rotor_speed, (*case.slip, -case.speed), case.spin
    )
    return p, state


def _grid(case: Landing) -> dict[str, Any]:
    """Return the arguments of `relief` for the grid of a fold along y."""
    rise, spacing = case.fold
    if rise == 0.0:
        return {}
    n = math.ceil(FLANK / spacing)
    heights = np.add.outer(np.zeros(2), rise * spacing * np.abs(np.arange(-n, n + 1.0)))
    return {"grid": heights, "corner": (-n * spacing, -0.5 * spacing), "spacing": spacing}


def _with_tips(frame: Airframe) -> Airframe:
    """Return the airframe with the outermost point of each propeller's disc as its hull."""
    assert frame.contact
    assert frame.propeller
    radius = 0.5 * frame.propeller.diameter
    hull = tuple(
        add(hub, scale(radius / math.hypot(hub[0], hub[1]), (hub[0], hub[1], 0.0))) for hub in frame.rotors.position
    )
    return frame.model_copy(update={"contact": frame.contact.model_copy(update={"hull": hull})})


def contact_of(p: MultirotorParameters) -> GroundContact:
    """Return the contact of a plant."""
    return next(e for e in p.effects if isinstance(e, GroundContact))


def exact(case: Landing, tolerance: float = 3e-15) -> tuple[np.ndarray, int]:
    """Return (states of the reference at `times`, shape (k, 22); number of its events)."""
    p, state = plant(case)
    e, layout = contact_of(p), p.layout
    rotor = next(x for x in p.effects if hasattr(x, "thrust_constant"))
    body = LandingBody(
        p.body.mass, np.array(p.body.inertia), np.array(e.feet),
        np.column_stack([layout.x_body, layout.y_body, layout.z_body]), np.array(layout.reaction_sign),
        rotor.thrust_constant * STANDARD_DENSITY, rotor.torque_constant * STANDARD_DENSITY, layout.lag_rate,
        STANDARD_GRAVITY,
    )  # fmt: skip
    ground = LandingGround(
        case.slope, case.bump, WAVE, e.stiffness, e.damping, 1.0 / e.inverse_width, e.static, e.dynamic,
        e.tangential_stiffness, e.tangential_damping, 1.0 / e.inverse_stiction, *case.step, *case.fold,
    )  # fmt: skip
    start = np.concatenate([of_state(state.motion), np.zeros(3 * len(e.feet))])
    states, events = landing(body, ground, start, times(), tolerance)
    return states[:, : len(start) - 3 * len(e.feet)], events


def times() -> np.ndarray:
    """Return the compared times [s], shape (k,)."""
    return np.arange(round(DURATION / INTERVAL) + 1) * INTERVAL


@cache
def airborne_steps(accuracy: float, integrator: str) -> int:
    """Return the number of steps per interval with an error in the air of at most the share used by `lapwing run`.

    Raises:
        ValueError: the integrator needs more than 64.
    """
    p, state = plant(FASTEST)
    x, y, z = state.motion.position_world
    state = state._replace(motion=state.motion._replace(position_world=(x, y, z + AIRBORNE_HEIGHT)))
    n, coarse = 1, _rows(integrator, p, state, 1)
    while n <= MAX_STEPS:
        fine = _rows(integrator, p, state, 2 * n)
        if errors(coarse, fine).max() <= IMPACT_SHARE * accuracy:
            return n
        n, coarse = 2 * n, fine
    raise ValueError(f"{integrator}: not accurate to {accuracy:g} in the air; use a method of higher order")


def fly(case: Landing, accuracy: float, integrator: str = "rk4_renormalised") -> tuple[np.ndarray, float]:
    """Return (states of the plant at `times`, shape (k, 22); wall time [s])."""
    p, state = plant(case)
    n = airborne_steps(accuracy, integrator)  # compiles or loads, too
    started = time.perf_counter()
    rows = _rows(integrator, with_tolerance(p, contact_tolerance(accuracy)), state, n)
    return rows, time.perf_counter() - started


def round_off(case: Landing, integrator: str = "rk4_renormalised") -> float:
    """Return the largest difference of flights at the strictest accuracy with initial states that differ by one bit.

    It is a sample, not a bound: a landing amplifies an initial difference by up to 3e5.
    """
    p, state = plant(case)
    p, n = with_tolerance(p, contact_tolerance(ACCURACIES[-1])), airborne_steps(ACCURACIES[-1], integrator)
    first, *others = (
        _rows(integrator, p, state._replace(motion=state.motion._replace(velocity_world=velocity)), n)
        for velocity in _last_bits(state.motion.velocity_world)
    )
    return max(float(errors(other, first).max()) for other in others)


def _last_bits(v: Vec3) -> list[Vec3]:
    """Return a vector, and three copies with one component replaced by the next double."""
    rows = np.array([v] * 4)
    for k in range(3):
        rows[k + 1, k] = np.nextafter(v[k], np.inf)
    return [tuple(row) for row in rows.tolist()]


def _rows(integrator: str, p: MultirotorParameters, state: MultirotorState, n: int) -> np.ndarray:
    """Return the coordinates at `times`, from n steps per interval."""
    method, off = integrators.get(integrator).Method(), (0.0,) * len(p.layout.x_body)
    motions = [state.motion]
    for tick in range(len(times()) - 1):
        state = multirotor.advance(method, p, (0, 0), tick, state, off, INTERVAL / n, n)
        motions.append(state.motion)
    return coordinates(motions[0], np.array([flatten(motion) for motion in motions]))


def errors(states: np.ndarray, reference: np.ndarray) -> np.ndarray:
    """Return the largest error of the state at each time, relative to 1 + size, shape (k,)."""
    return (np.abs(states - reference) / (1.0 + np.abs(reference))).max(axis=1)
