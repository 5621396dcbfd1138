"""Case 10: two quadrotors and their load, at the limits of the formulation."""

import math
from typing import Any

import numpy as np

from lapwing.dynamics.lie.quaternion import NO_ROTATION
from lapwing.dynamics.lie.ts2 import Swing
from lapwing.dynamics.vector import ZERO
from lapwing.kernels.state_tree import flatten
from lapwing.papers.cooperative_load.cooperative_load import (
    CooperativeLoadParameters,
    CooperativeLoadState,
    LiftCommand,
)
from lapwing.studies.accuracy.integrate import adapt_step
from lapwing.studies.stability.case_result import CaseResult, Curve, Plot, Row, Sweep
from lapwing.studies.stability.sampled_runs import rows

HARD = "loads of 0.1 g to 10 kg on links that are parallel, horizontal, or pass over the top: constraints and energy"

INERTIA = (0.0820, 0.0845, 0.1377)  # [kg m^2]
NO_LIFT = LiftCommand((0.0, 0.0), (ZERO, ZERO))
LENGTH, QUAD, G = (0.6, 0.8), 0.755, 9.81
DURATION, STEPS, SAMPLES = 10.0, 20_000, 200
LINK = (20, 26)  # columns of the two directions, each before its angular velocity
Pair = tuple[float, float]  # of both links
CASES: dict[str, tuple[float, Pair, Pair]] = {
    # load [kg], angles of the links from straight down [rad], their rates [rad/s]
    "light_load": (1e-4, (0.6, -0.5), (1.0, -1.5)),
    "heavy_load": (10.0, (0.6, -0.5), (1.0, -1.5)),
    "parallel_links": (0.4, (1e-9, 0.0), (2.0, 2.0)),
    "flat_links": (0.4, (0.5 * math.pi - 1e-9, -0.5 * math.pi + 1e-9), (0.5, -0.5)),
    "over_the_top": (0.4, (0.0, math.pi), (8.0, -7.0)),
}
LINK_BOUND, ENERGY_BOUND, LIGHT_BOUND = 1e-14, 1e-9, 1e-7
LINK_WHY = "round-off: the state space satisfies the constraint"
ENERGY_WHY = "the method's error: fourth power of 4e-3 rad per step, the angle of the fastest link, times 20 000 steps"
LIGHT_WHY = "six times the tolerance of 1e-12 in each of 16 000 steps"
ADAPTIVE, TOLERANCE = "rkmk54", 1e-12
SPRING = 1e5  # [N/m] of the baseline


def initial_state(name: str) -> tuple[Any, CooperativeLoadState]:
    """Return (parameters, initial state) of one of `CASES`, in free flight without thrust."""
    load, angles, rates = CASES[name]
    return formation(load, LENGTH, angles, rates, NO_LIFT)


def formation(
    load: float, lengths: Pair, angles: Pair, rates: Pair, control: LiftCommand
) -> tuple[Any, CooperativeLoadState]:
    """Return (parameters, state) of two level quadrotors with a load.

    Args:
        load: mass of the load [kg].
        lengths: lengths of the links [m].
        angles: angles of the links from straight down [rad].
        rates: their rates [rad/s].
        control: thrusts and moments.
    """
    p = CooperativeLoadParameters((QUAD, QUAD), (INERTIA, INERTIA), lengths, load, G, control)
    swings = tuple(
        Swing((math.sin(a), 0.0, -math.cos(a)), (0.0, -rate, 0.0)) for a, rate in zip(angles, rates, strict=True)
    )
    return p, CooperativeLoadState((0.0, 0.0, 50.0), (0.5, -0.3, 4.0), (NO_ROTATION,) * 2, (ZERO,) * 2, swings)


def bodies(lengths: Pair, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return positions [m] and velocities [m/s] of load and quadrotors for states `y`, shape (k, 3, 3) each."""
    position, velocity = [y[:, :3]], [y[:, 3:6]]
    for at, length in zip(LINK, lengths, strict=True):
        q, omega = y[:, at : at + 3], y[:, at + 3 : at + 6]
        position.append(y[:, :3] - length * q)
        velocity.append(y[:, 3:6] - length * np.cross(omega, q))
    return np.stack(position, axis=1), np.stack(velocity, axis=1)


def adaptive(p: Any, x: Any) -> np.ndarray:
    """Return the states, shape (SAMPLES + 1, n), with shorter steps where a light load moves fast."""
    out = np.full((SAMPLES + 1, len(flatten(x))), np.nan)
    adapt_step(p, x, np.linspace(0.0, DURATION, SAMPLES + 1), TOLERANCE, out)
    return out


def link_and_energy_errors(name: str, method: str = "rkmk4", steps: int = STEPS) -> tuple[np.ndarray, np.ndarray]:
    """Return (relative error of the link lengths, relative drift of the energy), shape (k,) each."""
    p, x = initial_state(name)
    y = adaptive(p, x) if method == ADAPTIVE else rows(method, p, x, DURATION, steps, SAMPLES)
    off = np.max([np.abs(np.linalg.norm(y[:, at : at + 3], axis=1) - 1.0) for at in LINK], axis=0)
    position, velocity = bodies(LENGTH, y)
    velocity, height = (np.ascontiguousarray(np.swapaxes(values, 0, 1)) for values in (velocity, position[..., 2]))
    return off, energy_drift(p.load_mass, velocity, height)


def energy_drift(load: float, velocity: np.ndarray, height: np.ndarray) -> np.ndarray:
    """Return the energy drift relative to the initial kinetic energy, shape (k,).

    Args:
        load: mass of the load [kg].
        velocity: of load and quadrotors [m/s], shape (3, k, 3).
        height: of load and quadrotors [m], shape (3, k).
    """
    mass = np.array([load, QUAD, QUAD])
    kinetic = 0.5 * np.einsum("b,bkc->k", mass, velocity**2)
    total = kinetic + G * mass @ height
    return np.abs(total - total[0]) / kinetic[0]


def baseline_errors(name: str, steps: int = STEPS) -> tuple[np.ndarray, np.ndarray]:
    """Return the errors of `link_and_energy_errors` for links as stiff springs, under RK4 (baseline)."""
    p, x = initial_state(name)
    q, omega = (np.array([getattr(s, field) for s in x.link]) for field in ("direction", "omega"))
    length, mass = np.array(LENGTH)[:, None], np.array([[p.load_mass], [QUAD], [QUAD]])
    r = np.vstack([x.load_position, x.load_position - length * q])
    v = np.vstack([x.load_velocity, x.load_velocity - length * np.cross(omega, q)])
    z, h, result = np.stack([r, v]), DURATION / steps, []

    def rate(z: np.ndarray) -> np.ndarray:
        d = z[0, 1:] - z[0, 0]
        size = np.sqrt((d * d).sum(axis=1, keepdims=True))
        pull = SPRING * (size - length) / size * d
        return np.stack([z[1], np.vstack([pull.sum(axis=0), -pull]) / mass - [0.0, 0.0, G]])

    with np.errstate(all="ignore"):
        for i in range(steps + 1):
            if i % (steps // SAMPLES) == 0:
                result.append(z)
            if i > 0 and not np.isfinite(z).all():
                result += [z * np.nan] * (SAMPLES + 1 - len(result))
                break
            k1 = rate(z)
            k2 = rate(z + 0.5 * h * k1)
            k3 = rate(z + 0.5 * h * k2)
            z = z + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + rate(z + h * k3))
        y = np.array(result)
        size = np.linalg.norm(y[:, 0, 1:] - y[:, 0, :1], axis=2)
        off = np.abs(size / length.T - 1.0).max(axis=1)
        return off, energy_drift(p.load_mass, y[:, 1].transpose(1, 0, 2), y[:, 0, :, 2].T)


def run() -> CaseResult:
    """Measure link length and energy of each load."""
    t = np.linspace(0.0, DURATION, SAMPLES + 1)
    spring = f"links as springs of {SPRING:g} N/m, RK4 at 5 ms"
    result, curves = [], []
    for name in CASES:
        light = name == "light_load"
        method = f"{ADAPTIVE} on TS^2, tolerance {TOLERANCE:g}" if light else "rkmk4 on TS^2, 0.5 ms"
        bound, why = (LIGHT_BOUND, LIGHT_WHY) if light else (ENERGY_BOUND, ENERGY_WHY)
        off, energy = link_and_energy_errors(name, ADAPTIVE if light else "rkmk4")
        baseline_off, baseline_energy = baseline_errors(name, STEPS // 10)
        result += [
            Row(f"{name}.links", method, "error of the link length, relative", LINK_BOUND, LINK_WHY, float(off.max()),
                spring, largest_finite(baseline_off)),
            Row(f"{name}.energy", method, "change of the energy, relative to the initial kinetic energy", bound, why,
                float(energy.max()), spring, largest_finite(baseline_energy)),
        ]  # fmt: skip
        curves += [Curve(name, t, np.maximum(energy, 1e-17)), Curve(f"{name}, springs", t, baseline_energy)]
    return CaseResult(result, Plot("time [s]", "change of the energy", curves, ENERGY_BOUND))


def largest_finite(values: np.ndarray) -> float:
    """Return the largest finite value."""
    return float(np.nanmax(np.where(np.isfinite(values), values, np.nan)))


def sweep() -> Sweep:
    """Decrease the load's mass at a step of 2 ms."""
    loads, steps = np.geomspace(1.0, 1e-9, 10), 5000
    curves: dict[str, list[float]] = {"rkmk4 on TS^2": [], "links as springs": []}
    original = CASES["light_load"]
    for load in loads:
        CASES["light_load"] = (float(load), *original[1:])
        curves["rkmk4 on TS^2"].append(float(link_and_energy_errors("light_load", steps=steps)[1].max()))
        curves["links as springs"].append(largest_finite(baseline_errors("light_load", steps)[1]))
    CASES["light_load"] = original
    result = [Curve(name, loads, np.array(values)) for name, values in curves.items()]
    return Sweep("mass of the load [kg]", "change of the energy", 1e-3, result, falling=True)
