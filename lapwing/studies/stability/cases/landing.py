"""Case 9: landing on stiff ground, rest, creep and stick-slip."""

import math
from pathlib import Path
from typing import Any

import numpy as np

import lapwing.scenes
from lapwing.dynamics import effects, integrators
from lapwing.dynamics.constants import STANDARD_GRAVITY
from lapwing.dynamics.environment import Environment
from lapwing.dynamics.lie.quaternion import exp
from lapwing.dynamics.terrain import relief
from lapwing.dynamics.vehicles import multirotor
from lapwing.dynamics.vehicles.airframe import load_airframe
from lapwing.studies.stability.case_result import CaseResult, Curve, Row, Sweep

HARD = "touchdown at 0.3 to 5 m/s on 1e6 N/m per foot at any phase of a step; rest; a slope; a sliding touchdown"

DRONE = load_airframe(Path(lapwing.scenes.__file__).parent / "vehicles/delivery_drone.toml")
METHOD = integrators.get("rk4_renormalised").Method()
MOTORS_OFF = (0.0,) * 4  # [V]
G, HEIGHT, STEP = STANDARD_GRAVITY, 0.35, 1e-3
SPEEDS = (0.3, 1.0, 3.0, 5.0)  # [m/s]
PHASES = np.arange(8) / 8  # phase of a step at the contact
EVERY_SECOND_PHASE = PHASES[::2]
STIFFNESS, DAMPING = 4e6, 4e3  # [N/m], [N s/m] of four feet
SHEAR, STICTION = 8e5, 0.15  # [N/m] of four feet along the ground, [m/s]


def state_above_slope(
    height: float, speed: float, angle: float = 0.0, ground: dict[str, Any] | None = None, **table: Any
) -> tuple[Any, Any]:
    """Return (parameters, state) at `height` [m] above a slope of `angle` [rad] along y, descending at `speed` [m/s].

    `ground` has further arguments of `relief`, `table` keys of the contact.
    """
    around = Environment(terrain=relief((0.0, math.tan(angle)), **(ground or {})))
    p = multirotor.parameters(DRONE, effects.from_scene({"gravity": {}, "ground_contact": table}, DRONE, around))
    over = HEIGHT + height
    place = (0.0, -over * math.sin(angle), over * math.cos(angle))
    state = multirotor.initial_state(p, place, exp((angle, 0.0, 0.0)), velocity_world=(0.0, 0.0, -speed))
    return p, state


def run_on(p: Any, state: Any, seconds: float, step: float = STEP, voltage: tuple[float, ...] = MOTORS_OFF) -> Any:
    """Return the state after a time [s] under motor voltages [V]."""
    return multirotor.advance(METHOD, p, (0, 0), 0, state, voltage, step, round(seconds / step))


def restitution(speed: float, phase: float, step: float, tolerance: float = multirotor.CONTACT_TOLERANCE) -> float:
    """Return the ratio of the speeds after and before the first contact, from the energies."""
    start = speed * (2e-3 + phase * STEP)
    p, state = state_above_slope(start, speed)
    p = p._replace(tolerance=tolerance)
    m = run_on(p, state, 12e-3, step).motion
    return math.sqrt(
        max(m.velocity_world[2] ** 2 + 2.0 * G * (m.position_world[2] - HEIGHT), 0.0) / (speed**2 + 2.0 * G * start)
    )


def baseline_restitution(speed: float, phase: float, step: float) -> float:
    """Return the `restitution` of forward Euler on spring and damper (baseline)."""
    mass = DRONE.mass.total
    z = start = speed * (2e-3 + phase * STEP)
    v = -speed
    for _ in range(round(12e-3 / step)):
        force = max(-STIFFNESS * z - DAMPING * v, 0.0) if z < 0.0 else 0.0
        z, v = z + step * v, v + step * (force / mass - G)
    return math.sqrt(max(v * v + 2.0 * G * z, 0.0) / (speed**2 + 2.0 * G * start))


def errors(step: float, exact: np.ndarray, function: Any) -> float:
    """Return the largest error of the restitution over all speeds and phases."""
    result = np.array([[function(v, phase, step) for phase in PHASES] for v in SPEEDS])
    return float(np.abs(result - exact).max())


def exact_restitution() -> np.ndarray:
    """Return the restitution at a tolerance of 1e-10 for each speed and phase, shape (4, 8)."""
    return np.array([[restitution(v, phase, STEP, 1e-10) for phase in PHASES] for v in SPEEDS])


def rest_place(phase: float, step: float, tolerance: float = multirotor.CONTACT_TOLERANCE) -> np.ndarray:
    """Return the rest position [m], shape (3,), after a tilted, yawed touchdown at 1 m/s."""
    p, state = state_above_slope(0.05 + phase * STEP, 1.0)
    m = state.motion._replace(attitude=exp((0.1, -0.06, 0.2)), velocity_world=(0.5, -0.3, -1.0))
    return np.array(run_on(p._replace(tolerance=tolerance), state._replace(motion=m), 4.0, step).motion.position_world)


def baseline_rest_place(phase: float, step: float) -> float:
    """Return the slide [m] of a point mass at the same speeds under forward Euler with sign friction (baseline)."""
    mass, x, z, u, v = DRONE.mass.total, 0.0, 0.05 + phase * STEP, math.hypot(0.5, 0.3), -1.0
    for _ in range(round(4.0 / step)):
        force = max(-STIFFNESS * z - DAMPING * v, 0.0) if z < 0.0 else 0.0
        drag = math.copysign(0.3 * force / mass, u)
        x, z, u, v = x + step * u, z + step * v, u - step * drag, v + step * (force / mass - G)
    return x


def rest_state(angle: float = 0.0) -> tuple[Any, Any]:
    """Return (parameters, state) at rest on a slope [rad], 3 s after a soft contact."""
    p, state = state_above_slope(0.0, 0.0, angle)
    return p, run_on(p, state, 3.0)


def baseline_rest() -> float:
    """Return the vertical motion [m] of the baseline contact in the tenth second after the contact."""
    mass, z, v, h = DRONE.mass.total, -DRONE.mass.total * G / STIFFNESS, -1e-3, STEP
    low, high = 0.0, -1.0
    for i in range(10_000):
        force = max(-STIFFNESS * z - DAMPING * v, 0.0) if z < 0.0 else 0.0
        z, v = z + h * v, v + h * (force / mass - G)
        if i >= 9000:
            low, high = min(low, z), max(high, z)
    return high - low


def drift_at_rest(seconds: float, angle: float) -> float:
    """Return the distance [m] from the rest position on a slope [rad] after a time [s]."""
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
    """Return the speeds [m/s] under stick-slip and sign friction, 2 s after a slide has begun at 1 m/s."""
    p, state = rest_state()
    m = state.motion._replace(velocity_world=(1.0, 0.0, 0.0))
    ours = np.abs(run_on(p, state._replace(motion=m), 2.0).motion.velocity_world).max()
    v = 1.0
    for _ in range(2000):
        v -= STEP * 0.3 * G * math.copysign(1.0, v)
    return float(ours), abs(v)


def slide(step: float, tolerance: float = multirotor.CONTACT_TOLERANCE) -> float:
    """Return the distance [m] of a sliding touchdown, 0.1 m/s down and 0.4 m/s forward, after 0.24 s."""
    p, state = state_above_slope(5e-3, 0.1)
    state = state._replace(motion=state.motion._replace(velocity_world=(0.4, 0.0, -0.1)))
    return float(run_on(p._replace(tolerance=tolerance), state, 0.24, step).motion.position_world[0])


def baseline_slide(step: float) -> float:
    """Return the `slide` of a point mass with a friction state that changes after each step (baseline).

    The anchor moves with the contact. A flag selects the coefficient: the static one while the mass slows down.
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
        is_slow = abs(u) < min(STICTION, before)
        sticks, before = (is_slow if over else True), abs(u)
        if over:
            reach = (0.5 if is_slow else 0.3) * press / SHEAR
            anchor = x + max(-reach, min(reach, anchor - x))
        u, v = u + step * pull / mass, v + step * (press / mass - G)
        x, z = x + step * u, z + step * v
    return x


def run() -> CaseResult:
    """Measure restitution, rest, creep and slide."""
    exact = exact_restitution()
    speed, baseline_speed = stick_slip()
    slope = math.radians(20.0)
    euler = "forward Euler on spring and damper"
    places = [
        np.linalg.norm(rest_place(f, k * STEP) - rest_place(f, STEP, 1e-10))
        for f in EVERY_SECOND_PHASE
        for k in (0.25, 0.5, 1.0)
    ]
    baseline_places = [
        abs(baseline_rest_place(f, STEP) - baseline_rest_place(f, STEP / 32.0)) for f in EVERY_SECOND_PHASE
    ]

    rows = [
        Row("restitution", "RK4 at 1 ms, the plant's step", "error of the restitution, 4 speeds at 8 phases of a step",
            1e-4, "ten times the tolerance of a substep: a bounce takes twenty substeps or more",
            errors(STEP, exact, restitution), f"{euler}, 1 ms", errors(STEP, exact, baseline_restitution)),
        Row("rest_place", "RK4 at 0.25, 0.5 and 1 ms",
            "distance [m] of the rest position from that at a tolerance of 1e-10, 4 phases", 1e-4,
            "ten times the tolerance of a substep, as for the restitution", float(max(places)),
            f"{euler}, 1 ms against 1/32 ms", max(baseline_places)),
        Row("rest", "friction elements, RK4 at 1 ms", "motion [m] in an hour of rest", 1e-9,
            "a hundredth of the penetration caused by round-off of a position of a few metres",
            drift_at_rest(3600.0, 0.0), f"{euler}, 1 ms, in a second", baseline_rest()),
        Row("creep", "friction elements, RK4 at 1 ms", "motion [m] in ten minutes on 20 degrees", 1e-6,
            "a thousandth of a millimetre, below the resolution of a survey", drift_at_rest(600.0, slope),
            "regularised friction, in a second", creep_distance(slope)),
        Row("stick_slip", "friction elements", "speed [m/s] after the end of a slide", 1e-6, "1 um/s: the feet stick",
            speed, "sign friction", baseline_speed),
        Row("slide", "friction elements, RK4 at 0.25, 0.5 and 1 ms",
            "distance [m] of the end of a sliding touchdown from that at a tolerance of 1e-10", 1e-6,
            "ten times the tolerance of a substep, over a slide of centimetres in a tenth of a second",
            max(abs(slide(k * STEP) - slide(STEP, 1e-10)) for k in (0.25, 0.5, 1.0)),
            "friction state changed after each step, 1 ms against 1/32 ms",
            abs(baseline_slide(STEP) - baseline_slide(STEP / 32.0))),
    ]  # fmt: skip
    return CaseResult(rows, sweep().plot())


def sweep() -> Sweep:
    """Increase the step: error of the restitution."""
    steps = STEP / np.array([16.0, 8.0, 4.0, 2.0, 1.0])
    exact = exact_restitution()
    methods = {"RK4, feet of the plant": restitution, "forward Euler": baseline_restitution}
    curves = [
        Curve(name, steps, np.array([errors(h, exact, function) for h in steps])) for name, function in methods.items()
    ]
    return Sweep("step [s]", "error of the restitution", 1e-4, curves)
