"""Case 6: more constraints than freedoms, singular positions, and starts that do not fit together."""

import math

import numpy as np
from scipy.integrate import solve_ivp

from lapwing.dynamics.lie.quaternion import Quaternion
from lapwing.dynamics.multibody.augmented import (
    ANY,
    RANK_TOLERANCE,
    accelerations,
    generalised_force,
    mass_roots,
    solve,
)
from lapwing.dynamics.multibody.body_kinematics import add_increment
from lapwing.dynamics.multibody.five_bodies import BodyState, arrays, machine
from lapwing.dynamics.multibody.five_body_stabilisation import assembled_state
from lapwing.dynamics.multibody.initial_conditions import consistent
from lapwing.dynamics.multibody.mechanisms import bricard, drone_system, four_bars
from lapwing.dynamics.multibody.simulation import simulate
from lapwing.dynamics.multibody.stabilisation import defects, rows
from lapwing.studies.stability.case_result import CaseResult, Curve, Plot, Row, Sweep
from lapwing.studies.stability.drone import PAPER, delivery_drone

HARD = "32 rows of rank 24; the Bricard loop, whose count leaves no freedom; a four-bar through its singular position"

GRAVITY = 9.81  # [m/s^2]
POSITION = 1e-6  # [m]
END, STEPS, LOOKS = 5.0, 2500, 50  # of the four-bars
GUESSES = np.geomspace(1e-9, 1e-2, 8)


def saddle(system, q, v, drive) -> np.ndarray:  # type: ignore[no-untyped-def]
    """Return the accelerations (6 n,) by one LU of the assembled matrix of masses and constraints: the baseline."""
    p, e = rows(system.arrays, q, v, drive)
    root, rotational = mass_roots(system.arrays, p)
    J = e.jacobian_t.T
    n, m = J.shape[1], J.shape[0]
    M = np.zeros((n + m, n + m))
    for b in range(len(root)):
        L = rotational[b].reshape(3, 3)
        M[6 * b : 6 * b + 3, 6 * b : 6 * b + 3] = root[b] ** 2 * np.eye(3)
        M[6 * b + 3 : 6 * b + 6, 6 * b + 3 : 6 * b + 6] = L @ L.T
    M[:n, n:], M[n:, :n] = J.T, J
    force = generalised_force(system.arrays, p, np.zeros((len(root), 6))).ravel()
    try:
        return np.linalg.solve(M, np.concatenate([force, e.gamma]))[:n]
    except np.linalg.LinAlgError:
        return np.zeros(n)  # it has no answer


def constraint_violation(system, q, v, drive, a) -> float:  # type: ignore[no-untyped-def]
    """Return the largest J a - gamma, relative to the largest gamma."""
    _, e = rows(system.arrays, q, v, drive)
    return float(np.abs(e.jacobian_t.T @ a - e.gamma).max() / max(np.abs(e.gamma).max(), 1.0))


def redundant() -> tuple[float, float]:
    """Return the errors of the drone with imposed propeller speeds, ours and the baseline's, of 20 random states."""
    rng, worst = np.random.default_rng(5), np.zeros(2)
    drone = delivery_drone(**PAPER, driven="speed")
    system = drone_system(drone)
    for _ in range(20):
        speeds, turn = rng.uniform(-400.0, 400.0, 4), rng.normal(size=4)
        pose = Quaternion(*map(float, turn / np.linalg.norm(turn)))
        chassis = BodyState(tuple(rng.normal(size=3)), pose, tuple(rng.normal(size=3)), tuple(3.0 * rng.normal(size=3)))
        q, v = arrays(
            assembled_state(machine(drone, (0.0, 0.0, -GRAVITY)), chassis, tuple(rng.uniform(-3, 3, 4)), tuple(speeds))
        )
        drive = np.column_stack([speeds, 10.0 * rng.normal(size=4)])
        ours = accelerations(system, q, v, None, drive).acceleration.ravel()
        both = [constraint_violation(system, q, v, drive, a) for a in (ours, saddle(system, q, v, drive))]
        worst = np.maximum(worst, both)
    return float(worst[0]), float(worst[1])


def off_by(size: float) -> tuple[float, float]:
    """Return the relative errors of the Bricard loop's accelerations with joints apart by `size` [m].

    With the initial rank as a bound, and with a newly determined rank.
    """
    system, q, v = bricard()
    off = add_increment(q, size * np.random.default_rng(1).normal(size=v.shape))
    no_load, no_drive = np.zeros((5, 6)), np.zeros((0, 2))
    true = accelerations(system, q, v).acceleration
    result = []
    for most in (29, ANY):
        a, _ = solve(system.arrays, off, v, no_load, no_drive, 0.0, 0.0, RANK_TOLERANCE, most)
        result.append(float(np.abs(a.acceleration - true).max() / np.abs(true).max()))
    return result[0], result[1]


def tips(t: np.ndarray, n: int) -> np.ndarray:
    """Return the first crank's tip of n four-bars at times t [s], from one equation of motion [m], shape (k, 3)."""
    inertia, weight = (n + 1) * (1.0 / 12.0 + 0.25) + n, GRAVITY * ((n + 1) * 0.5 + n)
    theta = solve_ivp(
        lambda t, y: [y[1], weight / inertia * math.sin(y[0])],
        (0.0, END), [0.0, 1.0], "DOP853", t, rtol=1e-13, atol=1e-13,
    ).y[0]  # fmt: skip
    return np.column_stack([np.sin(theta), np.cos(theta), 0.0 * theta])


def singular_position() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return (times, error of the first crank's tip [m], the baseline's) of two four-bars that turn over."""
    n = 2
    system, q, v = four_bars(n)
    motion = simulate(system, q, v, END / STEPS, STEPS, record_every=LOOKS)
    tip = tips(motion.time, n)
    off = np.abs(2.0 * motion.configuration[:, 0, :3] - tip).max(axis=1)
    baseline = simulate(system, q, v, END / STEPS, STEPS, "none", record_every=LOOKS)
    return motion.time, off, np.abs(2.0 * baseline.configuration[:, 0, :3] - tip).max(axis=1)


def inconsistent() -> tuple[float, float]:
    """Return the maximum constraint defect of a hand-assembled four-bar, after correction and before."""
    system, q, v = four_bars()
    rng, none = np.random.default_rng(1), np.zeros((0, 2))
    q, v = add_increment(q, 0.02 * rng.normal(size=v.shape)), v + 0.1 * rng.normal(size=v.shape)
    closed, moving = consistent(system, q, v)
    return max(defects(system.arrays, closed, moving, none)), max(defects(system.arrays, q, v, none))


def run() -> CaseResult:
    """Measure rank, redundancy off the constraints, a singular position and an inconsistent start."""
    t, off, baseline_off = singular_position()
    ours_off, fresh = off_by(1e-6)
    figures = [
        Row(
            "rank_24_of_32",
            "pivoted QR, rank revealed",
            "J a - gamma, relative",
            1e-10,
            "1e-16 times the condition of the rows, where blades turn at 400 rad/s",
            redundant()[0],
            "LU of the saddle-point matrix (none: singular)",
            redundant()[1],
        ),
        Row(
            "bricard",
            "rank of the start as a bound",
            "error of the accelerations 1e-6 m off the constraints, relative",
            1e-3,
            "a thousand times what the mechanism is apart by, which is what it can be",
            ours_off,
            "rank found afresh",
            fresh,
        ),
        Row(
            "four_bar",
            "RK4 with projection, 2 ms",
            "error of a crank's tip in 5 s [m]",
            POSITION,
            "a thousandth of the benchmark's own 1e-3 (IFToMM A02)",
            float(off.max()),
            "RK4 without stabilisation, 2 ms",
            float(np.nanmax(baseline_off)),
        ),
        Row(
            "start",
            "made consistent in the metric of the masses",
            "largest defect of a start off by 2 cm",
            1e-12,
            "round-off of coordinates of a few metres",
            inconsistent()[0],
            "the start as it was given",
            inconsistent()[1],
        ),
    ]
    curves = [Curve("projection", t, off), Curve("no stabilisation", t, baseline_off)]
    return CaseResult(figures, Plot("time [s]", "error of the crank's tip [m]", curves, POSITION))


def sweep() -> Sweep:
    """Increase the joint defect of the Bricard loop."""
    result = np.array([off_by(size) for size in GUESSES])
    names = ("rank of the start as a bound", "rank found afresh")
    curves = [Curve(name, GUESSES, result[:, k]) for k, name in enumerate(names)]
    return Sweep("joints apart by [m]", "error of the accelerations, relative", 0.5, curves)
