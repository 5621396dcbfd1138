"""Case 6: redundant constraints, singular positions, and inconsistent initial states."""

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
from lapwing.dynamics.multibody.mechanisms import bricard, drone_system, four_bars
from lapwing.dynamics.multibody.simulation import consistent, simulate
from lapwing.dynamics.multibody.stabilisation import defects, rows
from lapwing.studies.stability.case_result import CaseResult, Curve, Plot, Row, Sweep
from lapwing.studies.stability.drone import PAPER, delivery_drone

HARD = "32 constraints of rank 24; the overconstrained Bricard loop; a four-bar through its singular position"

GRAVITY = 9.81  # [m/s^2]
POSITION = 1e-6  # [m]
END, STEPS, RECORD_EVERY = 5.0, 2500, 50  # [s]; steps; steps between two samples: of the four-bars
DEFECTS = np.geomspace(1e-9, 1e-2, 8)


def saddle(system, q, v, drive) -> np.ndarray:  # type: ignore[no-untyped-def]
    """Return the accelerations (6 n,) by one LU decomposition of the saddle-point matrix (baseline)."""
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
        return np.zeros(n)  # singular: no solution


def constraint_violation(system, q, v, drive, a) -> float:  # type: ignore[no-untyped-def]
    """Return the largest J a - gamma, relative to the largest gamma."""
    _, e = rows(system.arrays, q, v, drive)
    return float(np.abs(e.jacobian_t.T @ a - e.gamma).max() / max(np.abs(e.gamma).max(), 1.0))


def redundancy_errors() -> tuple[float, float]:
    """Return the largest errors of Lapwing and baseline in 20 random states of the drone with imposed rotor speeds."""
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


def bricard_errors(size: float) -> tuple[float, float]:
    """Return the relative errors of the Bricard loop's accelerations with joint defects of `size` [m].

    The first with the initial rank as a bound, the second with a newly determined rank.
    """
    system, q, v = bricard()
    off = add_increment(q, size * np.random.default_rng(1).normal(size=v.shape))
    no_load, no_drive = np.zeros((5, 6)), np.zeros((0, 2))
    true = accelerations(system, q, v).acceleration
    result = []
    for rank in (29, ANY):
        a, _ = solve(system.arrays, off, v, no_load, no_drive, 0.0, 0.0, RANK_TOLERANCE, rank)
        result.append(float(np.abs(a.acceleration - true).max() / np.abs(true).max()))
    return result[0], result[1]


def tips(t: np.ndarray, n: int) -> np.ndarray:
    """Return the first crank's tip [m] of n four-bars at times t [s] from one equation of motion, shape (k, 3)."""
    inertia, weight = (n + 1) * (1.0 / 12.0 + 0.25) + n, GRAVITY * ((n + 1) * 0.5 + n)
    theta = solve_ivp(
        lambda t, y: [y[1], weight / inertia * math.sin(y[0])],
        (0.0, END), [0.0, 1.0], "DOP853", t, rtol=1e-13, atol=1e-13,
    ).y[0]  # fmt: skip
    return np.column_stack([np.sin(theta), np.cos(theta), 0.0 * theta])


def singular_position() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return (times [s], error of the first crank's tip [m], error of the baseline [m]) of two four-bars."""
    n = 2
    system, q, v = four_bars(n)
    motion = simulate(system, q, v, END / STEPS, STEPS, record_every=RECORD_EVERY)
    tip = tips(motion.time, n)
    off = np.abs(2.0 * motion.configuration[:, 0, :3] - tip).max(axis=1)
    baseline = simulate(system, q, v, END / STEPS, STEPS, "none", record_every=RECORD_EVERY)
    return motion.time, off, np.abs(2.0 * baseline.configuration[:, 0, :3] - tip).max(axis=1)


def start_defects() -> tuple[float, float]:
    """Return the largest constraint defects of an inaccurately assembled four-bar, after and before correction."""
    system, q, v = four_bars()
    rng, none = np.random.default_rng(1), np.zeros((0, 2))
    q, v = add_increment(q, 0.02 * rng.normal(size=v.shape)), v + 0.1 * rng.normal(size=v.shape)
    closed, moving = consistent(system, q, v)
    return max(defects(system.arrays, closed, moving, none)), max(defects(system.arrays, q, v, none))


def run() -> CaseResult:
    """Measure redundant constraints, a singular position and an inconsistent initial state."""
    t, off, baseline_off = singular_position()
    ours_off, baseline_rank_error = bricard_errors(1e-6)
    figures = [
        Row("rank_24_of_32", "rank-revealing QR", "J a - gamma, relative", 1e-10,
            "1e-16 times the condition number of the constraints, at propeller speeds of 400 rad/s",
            redundancy_errors()[0], "LU of the saddle-point matrix, singular", redundancy_errors()[1]),
        Row("bricard", "initial rank as a bound", "error of the accelerations 1e-6 m off the constraints, relative",
            1e-3, "a thousand times the joint defect", ours_off, "newly determined rank", baseline_rank_error),
        Row("four_bar", "RK4 with projection, 2 ms", "error of a crank's tip in 5 s [m]", POSITION,
            "a thousandth of the tolerance of the benchmark, 1e-3 (IFToMM A02)", float(off.max()),
            "RK4 without stabilisation, 2 ms", float(np.nanmax(baseline_off))),
        Row("start", "correction in the mass metric", "largest defect of an initial state with errors of 2 cm", 1e-12,
            "round-off of coordinates of a few metres", start_defects()[0], "no correction", start_defects()[1]),
    ]  # fmt: skip
    curves = [Curve("projection", t, off), Curve("no stabilisation", t, baseline_off)]
    return CaseResult(figures, Plot("time [s]", "error of the crank's tip [m]", curves, POSITION))


def sweep() -> Sweep:
    """Increase the joint defect of the Bricard loop."""
    result = np.array([bricard_errors(size) for size in DEFECTS])
    names = ("initial rank as a bound", "newly determined rank")
    curves = [Curve(name, DEFECTS, result[:, k]) for k, name in enumerate(names)]
    return Sweep("joint defect [m]", "error of the accelerations, relative", 0.5, curves)
