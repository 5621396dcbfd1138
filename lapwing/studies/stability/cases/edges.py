"""Case 18, edges: impact on a step, a foot in its inner corner, slide over an edge, take-off from a slope."""

import math
from typing import Any

import numpy as np

from lapwing.dynamics import effects
from lapwing.dynamics.environment import Environment
from lapwing.dynamics.terrain import relief, touch
from lapwing.dynamics.vehicles import multirotor
from lapwing.dynamics.vehicles.ground_equilibrium import resting_pose, static_equilibrium
from lapwing.dynamics.vehicles.multirotor_equations import STANDARD_DENSITY
from lapwing.studies.stability.case_result import CaseResult, Curve, Row, Sweep
from lapwing.studies.stability.cases.landing import DRONE, STEP, G, run_on
from lapwing.studies.stability.cases.slopes import DYNAMIC, energy

HARD = (
    "an impact on an upright step, its inner corner, a slide over an edge, a take-off from a slope: faces with corners"
)

SPEED, RISER, DROP = 2.0, 0.1, 0.4  # [m/s], [m], [m]
CORNER_DEPTH, SHIFT = 1e-4, 1e-12  # [m] depth in ground and wall; distance of two feet
ANGLE, LIFT_SHARE = math.radians(20.0), 0.5  # slope; share of the weight carried by the rotors
DENSITY = STANDARD_DENSITY


def state_at_rest(terrain: Any, share: float = 0.0) -> tuple[Any, Any, tuple[float, ...]]:
    """Return (parameters, state at rest, motor voltages [V]) of a drone with a thrust of `share` times its weight."""
    tables: dict[str, dict] = {"gravity": {}, "ground_contact": {}, "rotor_thrust": {}}
    p = multirotor.parameters(DRONE, effects.from_scene(tables, DRONE, Environment(terrain=terrain)))
    state = static_equilibrium(multirotor, p, resting_pose(DRONE.contact.feet if DRONE.contact else (), terrain), G)
    speed = math.sqrt(share * DRONE.mass.total * G / (4.0 * p.effects[2].thrust_constant * DENSITY))
    motion = state.motion._replace(rotor_speed=(speed,) * 4)
    return p, state._replace(motion=motion), (speed / p.layout.speed_per_volt,) * 4


def energy_gain(distance: float, rise: float, speed: float = SPEED, step: float = STEP) -> float:
    """Return the largest energy gain of a slide into a step, relative to its kinetic energy.

    Args:
        distance: from the start to the step [m].
        rise: height of the step [m], negative for an edge.
        speed: initial speed [m/s].
        step: integrator step [s].
    """
    p, state, _ = state_at_rest(relief(steps=[(distance, rise)]))
    state = state._replace(motion=state.motion._replace(velocity_world=(speed, 0.0, 0.0)))
    first = energy(p, state.motion)
    highest = first
    for _ in range(100):
        state = run_on(p, state, 0.01, step)
        highest = max(highest, energy(p, state.motion))
    return (highest - first) / (0.5 * p.body.mass * speed**2)


def baseline_energy_gain(distance: float, rise: float, speed: float = SPEED, step: float = STEP) -> float:
    """Return the `energy_gain` of a point mass on a height field (baseline)."""
    mass, x, z, v = DRONE.mass.total, 0.0, 0.0, 0.0
    highest = 0.0
    for _ in range(round(1.0 / step)):
        ground = rise if x > distance else 0.0
        force = max(4e6 * (ground - z) - 4e3 * v, 0.0) if z < ground else 0.0
        v += step * (force / mass - G)
        z += step * v
        x += step * speed
        highest = max(highest, 0.5 * v * v + G * z)
    return highest / (0.5 * speed**2)


def force_jump() -> float:
    """Return the relative change of the elastic force across equal depths in ground and wall."""
    ground = relief(steps=[(1.0, RISER)])
    depths = (touch(ground, (1.0 + CORNER_DEPTH + shift, 0.0, -CORNER_DEPTH)) for shift in (-SHIFT, SHIFT))
    first, second = (depth * np.array(normal) for depth, normal, _ in depths)
    return float(np.linalg.norm(first - second) / np.linalg.norm(first))


def baseline_force_jump() -> float:
    """Return the `force_jump` of the deeper face alone (baseline)."""
    wall, ground = np.array((-1.0, 0.0, 0.0)), np.array((0.0, 0.0, 1.0))
    behind = (CORNER_DEPTH - SHIFT, CORNER_DEPTH + SHIFT)
    first, second = (x * wall if x > CORNER_DEPTH else CORNER_DEPTH * ground for x in behind)
    return float(np.linalg.norm(first - second) / np.linalg.norm(first))


def acceleration_under_lift(share: float) -> float:
    """Return the downhill acceleration [m/s^2] of a drone with a thrust of `share` times its weight."""
    p, state, voltage = state_at_rest(relief(slope=(0.0, math.tan(ANGLE))), share)
    down = np.array([0.0, -math.cos(ANGLE), -math.sin(ANGLE)])
    sliding = tuple(float(v) for v in 0.2 * down)
    state = state._replace(motion=state.motion._replace(velocity_world=sliding))
    early = run_on(p, state, 0.3, voltage=voltage)
    late = run_on(p, early, 0.2, voltage=voltage)
    return float(np.subtract(late.motion.velocity_world, early.motion.velocity_world) @ down / 0.2)


def newton_acceleration(share: float) -> float:
    """Return the acceleration [m/s^2] of `acceleration_under_lift` by Newton's law."""
    return G * (math.sin(ANGLE) - DYNAMIC * max(math.cos(ANGLE) - share, 0.0))


def run() -> CaseResult:
    """Measure contact with a step, an edge and a slope."""
    faces, field = "a normal for each face, RK4 at 1 ms", "a height field, penetration up to the height of the step"
    none = "round-off: the ground adds no energy"
    newton = "error of the acceleration on 20 degrees with thrust of half the weight, relative to Newton's law"
    transient = "remaining oscillation of the feet's springs after 0.3 s"
    unloaded = G * (math.sin(ANGLE) - DYNAMIC * math.cos(ANGLE))
    rows = [
        Row("step", faces, "energy gain at a step of 10 cm, relative to the kinetic energy", 1e-9, none,
            energy_gain(0.4, RISER), field, baseline_energy_gain(0.4, RISER)),
        Row("corner", "distance from the nearest point outside",
            "change of the force between two points 2e-12 m apart, 0.1 mm deep in ground and wall, relative", 1e-7,
            "distance of the points over their depth", force_jump(), "the deeper face alone", baseline_force_jump()),
        Row("edge", faces, "energy gain at an edge of 40 cm, relative to the kinetic energy", 1e-9, none,
            energy_gain(0.4, -DROP), "forward Euler on spring and damper, upright", baseline_fall()),
        Row("take_off", "friction elements, RK4 at 1 ms", newton, 1e-3, transient,
            abs(acceleration_under_lift(LIFT_SHARE) / newton_acceleration(LIFT_SHARE) - 1.0),
            "friction of the full weight", abs(unloaded / newton_acceleration(LIFT_SHARE) - 1.0)),
    ]  # fmt: skip
    return CaseResult(rows, sweep().plot())


def baseline_fall() -> float:
    """Return the energy gain of a fall under forward Euler, relative to the kinetic energy of the slide (baseline)."""
    mass, z, v = DRONE.mass.total, DROP, 0.0
    highest = 0.0
    for _ in range(2000):
        force = max(-4e6 * z - 4e3 * v, 0.0) if z < 0.0 else 0.0
        z, v = z + STEP * v, v + STEP * (force / mass - G)
        highest = max(highest, 0.5 * v * v + G * (z - DROP))
    return highest / (0.5 * SPEED**2)


def sweep() -> Sweep:
    """Increase the speed into a step."""
    speeds = np.array([1.0, 2.0, 4.0, 8.0])
    gains = {"faces": energy_gain, "height field": baseline_energy_gain}
    curves = [
        Curve(name, speeds, np.maximum([gain(0.4, RISER, float(v)) for v in speeds], 1e-17))
        for name, gain in gains.items()
    ]
    return Sweep("speed into a step of 10 cm [m/s]", "energy gain, relative to the kinetic energy", 1e-9, curves)
