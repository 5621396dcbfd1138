"""Case 9: landing on stiff ground, rest, creep and stick-slip."""

import math
from pathlib import Path
from typing import Any

import numpy as np

import lapwing.scenes
from lapwing.dynamics import effects, integrators
from lapwing.dynamics.environment import Environment
from lapwing.dynamics.lie.quaternion import exp
from lapwing.dynamics.terrain import relief
from lapwing.dynamics.vehicles import multirotor
from lapwing.dynamics.vehicles.airframe import load_airframe
from lapwing.studies.stability.case_result import CaseResult, Curve, Row, Sweep

HARD = "landing at 0.3 to 5 m/s on 1e6 N/m a foot, at any phase of a step; rest; slopes; a landing that slides"

DRONE = load_airframe(Path(lapwing.scenes.__file__).parent / "vehicles/delivery_drone.toml")
METHOD = integrators.get("rk4_renormalised").Method()
OFF = (0.0,) * 4  # [V]
G, HEIGHT, STEP = 9.80665, 0.35, 1e-3
SPEEDS = (0.3, 1.0, 3.0, 5.0)  # [m/s]
PHASES = np.arange(8) / 8  # of a step at the touch
FEW = PHASES[::2]
STIFFNESS, DAMPING = 4e6, 4e3  # [N/m], [N s/m] of four feet
SHEAR, STICTION = 8e5, 0.15  # [N/m] of four feet along the ground, [m/s]


def state_above_slope(
    height: float, speed: float, angle: float = 0.0, ground: dict[str, Any] | None = None, **table: Any
) -> tuple[Any, Any]:
    """Return (parameters, state) at `height` [m] above a slope of `angle` [rad] along y, sinking at `speed` [m/s].

    `ground` has further arguments of `relief`, `table` keys of the contact.
    """
    around = Environment(terrain=relief((0.0, math.tan(angle)), **(ground or {})))
    p = multirotor.parameters(DRONE, effects.from_scene({"gravity": {}, "ground_contact": table}, DRONE, around))
    over = HEIGHT + height
    place = (0.0, -over * math.sin(angle), over * math.cos(angle))
    state = multirotor.initial_state(p, place, exp((angle, 0.0, 0.0)), velocity_world=(0.0, 0.0, -speed))
    return p, state


def run_on(p: Any, state: Any, seconds: float, step: float = STEP) -> Any:
    """Return the state after a time."""
    return multirotor.advance(METHOD, p, (0, 0), 0, state, OFF, step, round(seconds / step))


def restitution(speed: float, phase: float, step: float, tolerance: float = multirotor.CONTACT_TOLERANCE) -> float:
    """Return the speed after the first contact over that before, from the energies."""
    start = speed * (2e-3 + phase * STEP)
    p, state = state_above_slope(start, speed)
    p = p._replace(tolerance=tolerance)
    m = run_on(p, state, 12e-3, step).motion
    return math.sqrt(
        max(m.velocity_world[2] ** 2 + 2.0 * G * (m.position_world[2] - HEIGHT), 0.0) / (speed**2 + 2.0 * G * start)
    )


def baseline_restitution(speed: float, phase: float, step: float) -> float:
    """Return the restitution of forward Euler on spring and damper at the plant's step: the baseline."""
    mass = DRONE.mass.total
    z = start = speed * (2e-3 + phase * STEP)
    v = -speed
    for _ in range(round(12e-3 / step)):
        force = max(-STIFFNESS * z - DAMPING * v, 0.0) if z < 0.0 else 0.0
        z, v = z + step * v, v + step * (force / mass - G)
    return math.sqrt(max(v * v + 2.0 * G * z, 0.0) / (speed**2 + 2.0 * G * start))


def errors(step: float, exact: np.ndarray, way: Any) -> float:
    """Return the largest error of the restitution over all speeds and phases."""
    result = np.array([[way(v, phase, step) for phase in PHASES] for v in SPEEDS])
    return float(np.abs(result - exact).max())


def exact_restitution() -> np.ndarray:
    """Return the result for each speed and phase, shape (k, n), with a tolerance far below what is measured."""
    return np.array([[restitution(v, phase, STEP, 1e-10) for phase in PHASES] for v in SPEEDS])


def rest_place(phase: float, step: float, tolerance: float = multirotor.CONTACT_TOLERANCE) -> np.ndarray:
    """Return the rest position [m], shape (3,), after a leaning, yawing touch-down at 1 m/s."""
    p, state = state_above_slope(0.05 + phase * STEP, 1.0)
    m = state.motion._replace(attitude=exp((0.1, -0.06, 0.2)), velocity_world=(0.5, -0.3, -1.0))
    return np.array(run_on(p._replace(tolerance=tolerance), state._replace(motion=m), 4.0, step).motion.position_world)


def baseline_rest_place(phase: float, step: float) -> float:
    """Return the slide [m] of a mass at the same speeds, forward Euler, friction against the slip."""
    mass, x, z, u, v = DRONE.mass.total, 0.0, 0.05 + phase * STEP, math.hypot(0.5, 0.3), -1.0
    for _ in range(round(4.0 / step)):
        force = max(-STIFFNESS * z - DAMPING * v, 0.0) if z < 0.0 else 0.0
        drag = math.copysign(0.3 * force / mass, u)
        x, z, u, v = x + step * u, z + step * v, u - step * drag, v + step * (force / mass - G)
    return x


def rest_state(angle: float = 0.0) -> tuple[Any, Any]:
    """Return (parameters, state) at rest on a slope, some seconds after a soft contact."""
    p, state = state_above_slope(0.0, 0.0, angle)
    return p, run_on(p, state, 3.0)


def baseline_rest() -> float:
    """Return the motion [m] of the baseline contact in the last of ten seconds after it was set down."""
    mass, z, v, h = DRONE.mass.total, -DRONE.mass.total * G / STIFFNESS, -1e-3, STEP
    low, high = 0.0, -1.0
    for i in range(10_000):
        force = max(-STIFFNESS * z - DAMPING * v, 0.0) if z < 0.0 else 0.0
        z, v = z + h * v, v + h * (force / mass - G)
        if i >= 9000:
            low, high = min(low, z), max(high, z)
    return high - low


def drift_at_rest(seconds: float, angle: float) -> float:
    """Return the distance [m] from the rest position after a time."""
    p, state = rest_state(angle)
    later = run_on(p, state, seconds).motion
    return float(np.abs(np.subtract(later.position_world, state.motion.position_world)).max())


def creep_distance(angle: float) -> float:
    """Return the distance [m] from the rest position after a second of regularised friction."""
    _, rest = rest_state(angle)
    p, state = state_above_slope(0.0, 0.0, angle, friction="regularised")
    later = run_on(p, state._replace(motion=rest.motion), 1.0).motion
    return float(np.abs(np.subtract(later.position_world, rest.motion.position_world)).max())


def stick_slip() -> tuple[float, float]:
    """Return the speeds [m/s] a second after a slide at 1 m/s has ended: stick-slip friction, sign friction."""
    p, state = rest_state()
    m = state.motion._replace(velocity_world=(1.0, 0.0, 0.0))
    ours = np.abs(run_on(p, state._replace(motion=m), 2.0).motion.velocity_world).max()
    v = 1.0
    for _ in range(2000):
        v -= STEP * 0.3 * G * math.copysign(1.0, v)
    return float(ours), abs(v)


def slide(step: float, tolerance: float = multirotor.CONTACT_TOLERANCE) -> float:
    """Return how far [m] a touch-down at 0.1 m/s, at 0.4 m/s ahead, slides in 0.24 s."""
    p, state = state_above_slope(5e-3, 0.1)
    state = state._replace(motion=state.motion._replace(velocity_world=(0.4, 0.0, -0.1)))
    return float(run_on(p._replace(tolerance=tolerance), state, 0.24, step).motion.position_world[0])


def baseline_slide(step: float) -> float:
    """Return the same of a mass whose friction is decided after each step: the baseline.

    Its anchor is dragged along, and a flag says which coefficient holds: the static one while it slows down.
    """
    mass, x, z, u, v = DRONE.mass.total, 0.0, 5e-3, 0.4, -0.1
    anchor, sticks, touching, before = 0.0, False, False, 0.0
    for _ in range(round(0.24 / step)):
        press = max(-STIFFNESS * z - DAMPING * v, 0.0) if z < 0.0 else 0.0
        anchor = anchor if touching else x
        pull = SHEAR * (anchor - x) - DAMPING * u
        limit = (0.5 if sticks else 0.3) * press
        over, touching = abs(pull) > limit, press > 0.0
        pull = max(-limit, min(limit, pull))
        caught = abs(u) < min(STICTION, before)
        sticks, before = (caught if over else True), abs(u)
        if over:
            most = (0.5 if caught else 0.3) * press / SHEAR
            anchor = x + max(-most, min(most, anchor - x))
        u, v = u + step * pull / mass, v + step * (press / mass - G)
        x, z = x + step * u, z + step * v
    return x


def run() -> CaseResult:
    """Measure contact, rest, slope and slide."""
    exact = exact_restitution()
    left, chattering = stick_slip()
    slope = math.radians(20.0)
    euler = "forward Euler on spring and damper"
    places = [
        np.linalg.norm(rest_place(f, k * STEP) - rest_place(f, STEP, 1e-10)) for f in FEW for k in (0.25, 0.5, 1.0)
    ]
    baseline_places = [abs(baseline_rest_place(f, STEP) - baseline_rest_place(f, STEP / 32.0)) for f in FEW]
    every = "error of the restitution, 4 speeds at 8 phases of a step"
    rows = [
        Row(
            "restitution",
            "RK4 at 1 ms, the plant's step",
            every,
            1e-4,
            "ten times the tolerance of a part of a step: a bounce takes twenty parts and more",
            errors(STEP, exact, restitution),
            f"{euler}, 1 ms",
            errors(STEP, exact, baseline_restitution),
        ),
        Row(
            "rest_place",
            "RK4 at 0.25, 0.5 and 1 ms",
            "way [m] of the rest place from that at an accuracy of 1e-10, 4 phases",
            1e-4,
            "ten times the tolerance of a substep, as for the restitution",
            float(max(places)),
            f"{euler}, 1 ms against 1/32 ms",
            max(baseline_places),
        ),
        Row(
            "rest",
            "friction elements, RK4 at 1 ms",
            "way [m] in an hour of rest",
            1e-9,
            "a hundredth of the depth by which round-off of a position of metres shows",
            drift_at_rest(3600.0, 0.0),
            f"{euler}, 1 ms, over a second",
            baseline_rest(),
        ),
        Row(
            "creep",
            "friction elements, RK4 at 1 ms",
            "way [m] in ten minutes on 20 degrees",
            1e-6,
            "a thousandth of the millimetre that no survey would find",
            drift_at_rest(600.0, slope),
            "friction as a function of the slip, a second",
            creep_distance(slope),
        ),
        Row(
            "stick_slip",
            "friction elements",
            "speed [m/s] after a slide has ended",
            1e-6,
            "a micrometre a second: it sticks",
            left,
            "friction against the sign of the slip",
            chattering,
        ),
        Row(
            "slide",
            "friction elements, RK4 at 0.25, 0.5 and 1 ms",
            "way [m] of the end of a landing that slides from that at a tolerance of 1e-10",
            1e-6,
            "ten times the tolerance of a substep, over a slide of centimetres in a tenth of a second",
            max(abs(slide(k * STEP) - slide(STEP, 1e-10)) for k in (0.25, 0.5, 1.0)),
            "stick or slip decided after each step, 1 ms against 1/32 ms",
            abs(baseline_slide(STEP) - baseline_slide(STEP / 32.0)),
        ),
    ]
    return CaseResult(rows, sweep().plot())


def sweep() -> Sweep:
    """Increase the step: error of the restitution."""
    steps = STEP / np.array([16.0, 8.0, 4.0, 2.0, 1.0])
    exact = exact_restitution()
    ways = {"RK4, feet of the plant": restitution, "forward Euler": baseline_restitution}
    curves = [Curve(name, steps, np.array([errors(h, exact, way) for h in steps])) for name, way in ways.items()]
    return Sweep("step [s]", "error of the restitution", 1e-4, curves)
