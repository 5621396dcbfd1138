"""Case 23: late times, distant places, extreme stiffness and mass ratios, a wedge."""

import math
from typing import Any

import numpy as np

from lapwing.dynamics import effects
from lapwing.dynamics.terrain import LEVEL
from lapwing.dynamics.vector import ZERO
from lapwing.dynamics.vehicles import multirotor, multirotor_slung
from lapwing.studies.stability.case_result import CaseResult, Curve, Plot, Row
from lapwing.studies.stability.cases.landing import DRONE, METHOD, MOTORS_OFF, STEP, G, run_on, state_above_slope
from lapwing.studies.stability.cases.slopes import energy

HARD = (
    "a gust at 1e9 s, a fall at 1e7 m, ground of 1e9 N/m, a wedge, a rope that becomes taut, load ratios of 1e-6 to 1e6"
)

LATE, FAR, STIFFEST, SPEED = 1e9, 1e7, 1e9, 1.0  # [s], [m], [N/m] of a foot, [m/s]
RATIOS = (1e-6, 1.0, 1e6)  # mass of a load over that of the vehicle
SWING = 200.0  # [rad/s] of vehicle and load along the rope
BOUND, WHY = 1e-4, "a hundred times the tolerance of a substep"


def velocity_after_gust(start: float) -> np.ndarray:
    """Return the velocity [m/s] of a falling drone after a gust that begins 0.1 s after `start` [s]."""
    tables: dict[str, dict] = {"gravity": {}, "rotor_thrust": {}, "body_drag": {}}
    gust = {"wind_gust": {"peak": (25.0, 0.0, 0.0), "start": start + 0.1, "duration": 0.3}}
    p = multirotor.parameters(DRONE, effects.from_scene({**tables, **gust}, DRONE))
    state = multirotor.initial_state(p, (0.0, 0.0, 100.0))
    first = round(start / STEP)
    for tick in range(first, first + 500):
        state = multirotor.advance(METHOD, p, (0, 0), tick, state, MOTORS_OFF, STEP, 1)
    return np.array(state.motion.velocity_world)


def fall(x: float) -> np.ndarray:
    """Return the distance [m] travelled in half a second, shape (3,), by a body thrown from x [m] at 1 m/s along x."""
    p, state = state_above_slope(10.0, 0.0)
    motion = state.motion._replace(position_world=(x, 0.0, 10.0), velocity_world=(SPEED, 0.0, 0.0))
    end = run_on(p, state._replace(motion=motion), 0.5).motion.position_world
    return np.subtract(end, (x, 0.0, 10.0))


def rebound(stiffness: float) -> float:
    """Return the speed after over that before a fall at 1 m/s onto feet without damping."""
    start = 2.5e-3 * SPEED
    p, state = state_above_slope(start, SPEED, stiffness=stiffness, damping=0.0)
    first, last = energy(p, state.motion), energy(p, run_on(p, state, 6e-3).motion)
    rest = p.body.mass * G * state.motion.position_world[2] - p.body.mass * G * start
    return math.sqrt((last - rest) / (first - rest))


def energy_in_wedge() -> float:
    """Return the largest gain of energy, relative, of a drone that falls into a wedge of two slopes of 30 degrees."""
    x = np.arange(-8.0, 9.0)
    grid = {"grid": np.tile(abs(x) * math.tan(math.radians(30.0)), (len(x), 1)), "corner": (-8.0, -8.0)}
    p, state = state_above_slope(0.6, 1.0, ground=grid)
    first = highest = energy(p, state.motion)
    for _ in range(500):
        state = run_on(p, state, 4e-3)
        highest = max(highest, energy(p, state.motion))
    return highest / first - 1.0


def rope_rebound(ratio: float) -> float:
    """Return the speed of approach over that of separation of vehicle and load, in free fall on a rope without damping.

    `ratio` is the load's mass over the vehicle's.
    """
    mass = DRONE.mass.total
    stiffness = mass * ratio / (1.0 + ratio) * SWING**2
    sling = multirotor_slung.Sling(ratio * mass, 1.0, stiffness, 0.0, ZERO, 0.0, LEVEL)
    p = multirotor_slung.parameters(DRONE, sling, effects.from_scene({"gravity": {}, "rotor_thrust": {}}, DRONE))
    state: Any = multirotor_slung.initial_state(p, (0.0, 0.0, 100.0))
    motion = state.motion._replace(load_position=(0.0, 0.0, 99.01), load_velocity=(0.0, 0.0, -SPEED))
    end = run_on(p, state._replace(motion=motion), 0.04).motion
    return (end.load_velocity[2] - end.vehicle.velocity_world[2]) / SPEED


def euler_rebound(omega: float) -> float:
    """Return the `rebound` of forward Euler on a spring of this angular frequency [rad/s], 1 ms (baseline)."""
    x, v = 0.0, -SPEED
    for _ in range(50):
        x, v = x + STEP * v, v - STEP * omega**2 * min(x, 0.0)
    return v / SPEED


def run() -> CaseResult:
    """Measure each extreme against the ordinary case or a closed form."""
    late, early = velocity_after_gust(LATE), velocity_after_gust(0.0)
    ropes = np.array([abs(rope_rebound(ratio) - 1.0) for ratio in RATIOS])
    exact = np.array([0.5 * SPEED, 0.0, -0.125 * G])
    single = float(np.spacing(np.float32(FAR)))
    stiff = math.sqrt(4.0 * STIFFEST / DRONE.mass.total)
    rk4, euler = "RK4 at 1 ms under error control", "forward Euler, 1 ms"
    rows = [
        Row("late_gust", "RK4, time from the number of steps", "change of velocity [m/s] by a start at 1e9 s", 1e-5,
            "round-off of the time, 1.2e-7 s, times the acceleration by the gust", float(abs(late - early).max()),
            "time in single precision: no gust", float(abs(early - [0.0, 0.0, early[2]]).max())),
        Row("far_fall", "RK4", "error [m] of a throw of half a second at 1e7 m", 1e-6,
            "round-off of the position, 1.9e-9 m, in each of 500 steps", float(abs(fall(FAR) - exact).max()),
            "position in single precision", single),
        Row("stiff_ground", rk4, "error of the speed after a fall onto 1e9 N/m without damping, relative", BOUND, WHY,
            abs(rebound(STIFFEST) - 1.0), euler, abs(euler_rebound(stiff) - 1.0)),
        Row("wedge", rk4, "energy gain in a wedge of 120 degrees, relative", 1e-9,
            "round-off: the ground adds no energy", energy_in_wedge(), euler, abs(euler_rebound(SWING) ** 2 - 1.0)),
        Row("rope", rk4, "error of the speed after a rope is taut and slack again, relative, worst of 3 load ratios",
            BOUND, WHY, float(ropes.max()), euler, abs(euler_rebound(SWING) - 1.0)),
    ]  # fmt: skip
    curve = Curve("rope", np.array(RATIOS), ropes)
    plot = Plot("mass of the load over that of the vehicle", "error of the speed", [curve], BOUND, log_x=True)
    return CaseResult(rows, plot)
