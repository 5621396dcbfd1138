"""Case 10, its ends: a load that is let go, and links that push where cables would be slack."""

import math
from typing import Any

import numpy as np
from scipy.integrate import quad

from lapwing.dynamics.lie.quaternion import NO_ROTATION
from lapwing.dynamics.lie.ts2 import Swing
from lapwing.dynamics.vector import ZERO
from lapwing.dynamics.vehicles.cooperative_load import CooperativeLoadParameters, CooperativeLoadState, LiftCommand
from lapwing.dynamics.vehicles.released_load import release
from lapwing.kernels.state_tree import unflatten
from lapwing.messages.topics import BODIES, LIFT, TRUTH
from lapwing.studies.stability.case_result import CaseResult, Curve, Plot, Row
from lapwing.studies.stability.cases.cooperative_load import INERTIA, LENGTH, QUAD, G
from lapwing.studies.stability.flights import fly
from lapwing.studies.stability.sampled_runs import rows
from lapwing.studies.tension import pushes, tension

HARD = "a load let go in full swing; links that push on the way over the top, where cables would be slack"

LOAD, THRUST = 0.4, 12.0  # [kg], [N] of one quadrotor
STEP, SWUNG, FALL = 2.5e-3, 1.0, 2.0  # [s]
KAPPA, SAME = 3.5, 0.7  # square of the rate below, of U / M L; [m] of both links: goes slack for 2 < kappa < 5
PUSHING = "formation.path=[[-2.5,0.0,0.75],[1.0,0.0,5.0],[0.0,0.0,-6.0]]"  # down faster than a load falls
KEPT, FALLEN, WHEN, FORCE = 1e-13, 1e-11, 1e-5, 1e-10


def formation(lengths: tuple[float, float], angles: tuple[float, float], rates: tuple[float, float]) -> tuple[Any, Any]:
    """Return (parameters, state) of two level quadrotors at constant thrust; link angles from straight down."""
    drive = LiftCommand((THRUST, THRUST), (ZERO, ZERO))
    p = CooperativeLoadParameters((QUAD, QUAD), (INERTIA, INERTIA), lengths, LOAD, G, drive)
    swings = tuple(
        Swing((math.sin(a), 0.0, -math.cos(a)), (0.0, -rate, 0.0)) for a, rate in zip(angles, rates, strict=True)
    )
    return p, CooperativeLoadState((0.0, 0.0, 50.0), (0.5, -0.3, 4.0), (NO_ROTATION,) * 2, (ZERO,) * 2, swings)


def bodies(lengths: tuple[float, float], y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return positions [m] and velocities [m/s] of load and quadrotors, shape (k, 3, 3) each, of state rows."""
    position, velocity = [y[:, :3]], [y[:, 3:6]]
    for at, length in zip((20, 26), lengths, strict=True):
        q, omega = y[:, at : at + 3], y[:, at + 3 : at + 6]
        position.append(y[:, :3] - length * q)
        velocity.append(y[:, 3:6] - length * np.cross(omega, q))
    return np.stack(position, axis=1), np.stack(velocity, axis=1)


def accounts(position: np.ndarray, velocity: np.ndarray) -> np.ndarray:
    """Return momentum [kg m/s], angular momentum about the load's first place [kg m^2/s], energy [J], shape (7,)."""
    mass, r = np.array([LOAD, QUAD, QUAD])[:, None], position - [0.0, 0.0, 50.0]
    energy = float(np.sum(mass * (0.5 * velocity**2 + [0.0, 0.0, G] * r)))
    return np.array([*(mass * velocity).sum(axis=0), *np.cross(r, mass * velocity).sum(axis=0), energy])


def let_go() -> tuple[float, float, float, float]:
    """Change of the accounts at the release, and distance [m] from free fall after it; ours and baseline of each."""
    p, x = formation(LENGTH, (0.6, -0.5), (5.0, -4.0))
    steps = round(SWUNG / STEP) * 5
    y = rows("rkmk4", p, x, SWUNG, steps, steps // 5)
    position, velocity = bodies(LENGTH, y)
    before, size = accounts(position[-1], velocity[-1]), np.abs(accounts(position[-1], np.abs(velocity[-1])))
    free, state = release(p, unflatten(x, tuple(map(float, y[-1]))))
    r = np.array([state.load_position, *state.quad_position])
    v = np.array([state.load_velocity, *state.quad_velocity])
    drift = float((np.abs(accounts(r, v) - before) / size).max())
    lost = float((np.abs(accounts(r, (position[-1] - position[-2]) / STEP) - before) / size).max())
    count = round(FALL / 1e-3)
    end = rows("rk4_renormalised", free, state, FALL, count, 1)[-1]
    up = np.array([0.0, THRUST / QUAD, THRUST / QUAD])[:, None] * [0.0, 0.0, 1.0] - [0.0, 0.0, G]
    exact = r + FALL * v + 0.5 * FALL**2 * up
    ours = np.array([end[:3], end[20:23], end[23:26]])
    light = rows("rkmk4", p._replace(load_mass=1e-3), unflatten(x, tuple(map(float, y[-1]))), FALL, 10 * count, 1)
    held, _ = bodies(LENGTH, light)
    return drift, lost, float(np.abs(ours - exact).max()), float(np.abs(held[-1] - exact).max())


def over_the_top() -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return (times [s], tension of both links [N], that of the closed form [N], angle [rad]), (k,) each."""
    rate = math.sqrt(KAPPA * THRUST / (QUAD * SAME))
    p, x = formation((SAME, SAME), (0.0, 0.0), (rate, rate))
    duration = 0.5
    samples = round(duration / STEP)
    y = rows("rkmk4", p, x, duration, 5 * samples, samples)
    position, velocity = bodies((SAME, SAME), y)
    force = np.broadcast_to([0.0, 0.0, THRUST], (len(y), 2, 3))
    result = tension(position, velocity, force, p._asdict()).sum(axis=1)
    angle = np.unwrap(np.arctan2(y[:, 20], -y[:, 22]))
    mass = 2.0 * QUAD
    reduced, pull = mass * LOAD / (mass + LOAD), 2.0 * THRUST / mass
    exact = reduced * pull * (KAPPA - 2.0 + 3.0 * np.cos(angle))
    return np.linspace(0.0, duration, samples + 1), result, exact, angle


def slack_at() -> float:
    """Return the time [s] at which the tension vanishes in closed form."""
    pull = THRUST / (QUAD * SAME)  # [1/s^2]
    end = math.acos((2.0 - KAPPA) / 3.0)
    return float(quad(lambda a: 1.0 / math.sqrt(pull * (KAPPA - 2.0 + 2.0 * math.cos(a))), 0.0, end, epsabs=1e-13)[0])


def silent() -> tuple[float, float]:
    """Return 1 for each flight with a pushing link that the event, or watching the length, does not report."""
    flight = fly("cooperative_load", [PUSHING], (TRUTH, BODIES, LIFT))
    reported = any(event.kind == "slack" for event in flight.events)
    place, length = (
        flight.topic("body_states").position,
        np.array(flight.origin.scene["cooperative_load"]["link_length"]),
    )
    off = np.abs(np.linalg.norm(place[:, :1] - place[:, 1:], axis=2) / length - 1.0).max()
    return float(not reported), float(off < 1e-9)


def run() -> CaseResult:
    """Measure the release and afterwards, the top and beyond."""
    drift, lost, fallen, held = let_go()
    t, result, exact, angle = over_the_top()
    when = slack_at()
    sharing = np.abs(exact - LOAD * G * np.cos(angle)) / exact[0]
    horizontal = float(np.interp(0.5 * math.pi, angle, t))
    quiet, unseen = silent()
    watched = "tension from Newton's law along the link"
    figures = [
        Row("release", "every body keeps its position and velocity",
            "change of momentum, angular momentum and energy, relative", KEPT, "round-off of positions of 50 m",
            drift, "velocities from the last two positions, 2.5 ms apart", lost),
        Row("fall", "free bodies, RK4 at 1 ms", "distance [m] from free fall and constant thrust in 2 s", FALLEN,
            "round-off: 4e-15 m for each of 2000 steps, were every one of one sign",
            fallen, "the load weighs a gram, the links stay", held),
        Row("slack", f"{watched}, at every 2.5 ms", "time [s] at which it vanishes, against the closed form", WHEN,
            "a line between two readings: a share of its bend, 10 /s^2 times the square of 2.5 ms",
            abs(pushes(t, result)[0].start - when), "when the link is level", abs(horizontal - when)),
        Row("tension", watched, "tension against the closed form, over that at first", FORCE,
            "the error of RK4 in the rates: 1e-2 rad a step, fourth power, for 1000 steps",
            float(np.abs(result - exact).max() / exact[0]), "the load's weight along the link", float(sharing.max())),
        Row("told", "an event with link, time and force", "flights in which a link pushes without a word", 0.0,
            "none: a flight on cables would have gone another way", quiet, "the length of links is watched", unseen),
    ]  # fmt: skip
    curves = [Curve("tension of both links", t, result), Curve("closed form", t, exact), Curve("slack", t, 0.0 * t)]
    return CaseResult(figures, Plot("time [s]", "tension [N]", curves, log_y=False))
