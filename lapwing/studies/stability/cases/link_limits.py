"""Case 10, limits: release of a load, and links under compression where cables would be slack."""

import math

import numpy as np
from scipy.integrate import quad

from lapwing.dynamics.vector import ZERO
from lapwing.flights.tension import pushes, tension
from lapwing.kernels.state_tree import unflatten
from lapwing.messages.topics import BODIES, LIFT, TRUTH
from lapwing.papers.cooperative_load.cooperative_load import LiftCommand
from lapwing.papers.cooperative_load.released_load import release
from lapwing.studies.stability.case_result import CaseResult, Curve, Plot, Row
from lapwing.studies.stability.cases.cooperative_load import LENGTH, QUAD, G, bodies, formation
from lapwing.studies.stability.flights import fly
from lapwing.studies.stability.sampled_runs import rows

HARD = "release of a swinging load; links under compression near the top, where cables would be slack"

LOAD, THRUST = 0.4, 12.0  # [kg], [N] of one quadrotor
LIFT_COMMAND = LiftCommand((THRUST, THRUST), (ZERO, ZERO))
STEP, SWING, FALL = 2.5e-3, 1.0, 2.0  # [s]
KAPPA, LINK = 3.5, 0.7  # squared rate at the bottom over U / (M L), slack for 2 < kappa < 5; [m] length of both links
PUSHING = "formation.path=[[-2.5,0.0,0.75],[1.0,0.0,5.0],[0.0,0.0,-6.0]]"  # descends faster than free fall
RELEASE_BOUND, FALL_BOUND, TIME_BOUND, FORCE_BOUND = 1e-13, 1e-11, 1e-5, 1e-10


def conserved_quantities(position: np.ndarray, velocity: np.ndarray) -> np.ndarray:
    """Return momentum [kg m/s], angular momentum about the load's start [kg m^2/s] and energy [J], shape (7,)."""
    mass, r = np.array([LOAD, QUAD, QUAD])[:, None], position - [0.0, 0.0, 50.0]
    energy = float(np.sum(mass * (0.5 * velocity**2 + [0.0, 0.0, G] * r)))
    return np.array([*(mass * velocity).sum(axis=0), *np.cross(r, mass * velocity).sum(axis=0), energy])


def release_errors() -> tuple[float, float, float, float]:
    """Return the changes of `conserved_quantities` at the release and the distances [m] from free fall after it.

    Each for Lapwing's method and for the baseline: (change, baseline change, distance, baseline distance).
    """
    p, x = formation(LOAD, LENGTH, (0.6, -0.5), (5.0, -4.0), LIFT_COMMAND)
    steps = round(SWING / STEP) * 5
    y = rows("rkmk4", p, x, SWING, steps, steps // 5)
    position, velocity = bodies(LENGTH, y)
    before = conserved_quantities(position[-1], velocity[-1])
    size = np.abs(conserved_quantities(position[-1], np.abs(velocity[-1])))
    free, state = release(p, unflatten(x, tuple(map(float, y[-1]))))
    r = np.array([state.load_position, *state.quad_position])
    v = np.array([state.load_velocity, *state.quad_velocity])
    drift = float((np.abs(conserved_quantities(r, v) - before) / size).max())
    baseline_change = float(
        (np.abs(conserved_quantities(r, (position[-1] - position[-2]) / STEP) - before) / size).max()
    )
    count = round(FALL / 1e-3)
    end = rows("rk4_renormalised", free, state, FALL, count, 1)[-1]
    acceleration = np.array([0.0, THRUST / QUAD, THRUST / QUAD])[:, None] * [0.0, 0.0, 1.0] - [0.0, 0.0, G]
    exact = r + FALL * v + 0.5 * FALL**2 * acceleration
    ours = np.array([end[:3], end[20:23], end[23:26]])
    light = rows("rkmk4", p._replace(load_mass=1e-3), unflatten(x, tuple(map(float, y[-1]))), FALL, 10 * count, 1)
    baseline_fall_error, _ = bodies(LENGTH, light)
    return (
        drift,
        baseline_change,
        float(np.abs(ours - exact).max()),
        float(np.abs(baseline_fall_error[-1] - exact).max()),
    )


def over_the_top() -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return (times [s], tension of both links [N], tension in closed form [N], angle [rad]), shape (k,) each."""
    rate = math.sqrt(KAPPA * THRUST / (QUAD * LINK))
    p, x = formation(LOAD, (LINK, LINK), (0.0, 0.0), (rate, rate), LIFT_COMMAND)
    duration = 0.5
    samples = round(duration / STEP)
    y = rows("rkmk4", p, x, duration, 5 * samples, samples)
    position, velocity = bodies((LINK, LINK), y)
    force = np.broadcast_to([0.0, 0.0, THRUST], (len(y), 2, 3))
    result = tension(position, velocity, force, p._asdict()).sum(axis=1)
    angle = np.unwrap(np.arctan2(y[:, 20], -y[:, 22]))
    mass = 2.0 * QUAD
    reduced, pull = mass * LOAD / (mass + LOAD), 2.0 * THRUST / mass
    exact = reduced * pull * (KAPPA - 2.0 + 3.0 * np.cos(angle))
    return np.linspace(0.0, duration, samples + 1), result, exact, angle


def slack_time() -> float:
    """Return the time [s] at which the tension vanishes in closed form."""
    pull = THRUST / (QUAD * LINK)  # [1/s^2]
    end = math.acos((2.0 - KAPPA) / 3.0)
    return float(quad(lambda a: 1.0 / math.sqrt(pull * (KAPPA - 2.0 + 2.0 * math.cos(a))), 0.0, end, epsabs=1e-13)[0])


def unreported() -> tuple[float, float]:
    """Return 1 if the event, and 1 if the link length, does not show a compressed link of a flight; else 0."""
    flight = fly("cooperative_load", [PUSHING], (TRUTH, BODIES, LIFT))
    reported = any(event.kind == "slack" for event in flight.events)
    place, length = flight.topic("body_states").position, flight.origin.scene["cooperative_load"]["link_length"]
    off = np.abs(np.linalg.norm(place[:, :1] - place[:, 1:], axis=2) / np.array(length) - 1.0).max()
    return float(not reported), float(off < 1e-9)


def run() -> CaseResult:
    """Measure the release, the fall, and the passage over the top."""
    drift, baseline_change, fall_error, baseline_fall_error = release_errors()
    t, result, exact, angle = over_the_top()
    time = slack_time()
    baseline_error = np.abs(exact - LOAD * G * np.cos(angle)) / exact[0]
    horizontal = float(np.interp(0.5 * math.pi, angle, t))
    unreported_events, unreported_lengths = unreported()
    method = "tension from Newton's law along the link"
    figures = [
        Row("release", "position and velocity of every body are kept",
            "change of momentum, angular momentum and energy, relative", RELEASE_BOUND,
            "round-off of positions of 50 m",
            drift, "velocities from the last two positions, 2.5 ms apart", baseline_change),
        Row("fall", "free bodies, RK4 at 1 ms", "distance [m] from free fall and constant thrust in 2 s", FALL_BOUND,
            "round-off of 4e-15 m in each of 2000 steps, all of one sign",
            fall_error, "a load of 1 g on the links", baseline_fall_error),
        Row("slack", f"{method}, every 2.5 ms", "error of the time of zero tension [s]", TIME_BOUND,
            "linear interpolation: curvature of 10 /s^2 times the square of 2.5 ms",
            abs(pushes(t, result)[0].start - time), "time of the horizontal link", abs(horizontal - time)),
        Row("tension", method, "error of the tension, relative to the initial tension", FORCE_BOUND,
            "error of RK4 in the rates: fourth power of 1e-2 rad per step, times 1000 steps",
            float(np.abs(result - exact).max() / exact[0]), "the weight of the load along the link",
            float(baseline_error.max())),
        Row("reported", "event with link, time and force", "flights with a compressed link and no event", 0.0,
            "none: a flight with cables would differ", unreported_events,
            "check of the link length", unreported_lengths),
    ]  # fmt: skip
    curves = [Curve("tension of both links", t, result), Curve("closed form", t, exact), Curve("slack", t, 0.0 * t)]
    return CaseResult(figures, Plot("time [s]", "tension [N]", curves, log_y=False))
