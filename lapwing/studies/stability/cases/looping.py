"""Case 1: continuous looping through the vertical and upside down."""

import math

import numpy as np

from lapwing.dynamics.lie.quaternion import from_roll_pitch_yaw
from lapwing.dynamics.vehicles.rigid_body import FreeBodyParameters, RigidBody
from lapwing.studies.accuracy.reference import to_world
from lapwing.studies.stability.case_result import CaseResult, Curve, Plot, Row, Sweep
from lapwing.studies.stability.sampled_runs import drift, run_fixed_steps

HARD = "60 s of continuous loops: pitch passes through 90 degrees twice per turn, and the vehicle flies upside down"

INERTIA = (0.27, 0.26, 0.42)  # [kg m^2] of the delivery drone
DURATION, STEPS, SAMPLES = 60.0, 60_000, 600
RATE = 2.0 * math.pi  # [rad/s] one loop per second
OFFSET = 1e-3  # [rad/s] roll and yaw rates, which set the distance to the pole
BOUND = 1.3e-11
WHY = "round-off of 2e-16 in each of 60 000 steps, all of one sign"


def initial_state(offset: float) -> RigidBody:
    """Return the initial state of a loop with equal roll and yaw rates `offset` [rad/s]."""
    return RigidBody(from_roll_pitch_yaw(0.0, 0.0, 0.0), (offset, RATE, offset))


def momentum(y: np.ndarray) -> np.ndarray:
    """Return the angular momentum in the world [N m s], shape (k, 3), which is constant."""
    return to_world(y[:, :9], y[:, 9:12] * INERTIA)


def euler_angles(offset: float, steps: int, samples: int) -> np.ndarray:
    """Return the coordinates, shape (samples + 1, 12), of RK4 on Euler angles with 1/cos(pitch) (baseline)."""
    A, B, C = INERTIA

    def rate(y: tuple[float, ...]) -> tuple[float, ...]:
        roll, pitch, _, p, q, r = y
        cosine = math.cos(pitch) or 1e-300  # avoids only division by zero
        turn = q * math.sin(roll) + r * math.cos(roll)
        return (
            p + turn * math.sin(pitch) / cosine, q * math.cos(roll) - r * math.sin(roll), turn / cosine,
            (B - C) / A * q * r, (C - A) / B * r * p, (A - B) / C * p * q,
        )  # fmt: skip

    y: tuple[float, ...] = (0.0, 0.0, 0.0, offset, RATE, offset)
    h, result = DURATION / steps, []
    for i in range(steps + 1):
        if i % (steps // samples) == 0:
            result.append(_coordinates(y))
        k1 = rate(y)
        k2 = rate(tuple(a + 0.5 * h * b for a, b in zip(y, k1, strict=True)))
        k3 = rate(tuple(a + 0.5 * h * b for a, b in zip(y, k2, strict=True)))
        k4 = rate(tuple(a + h * b for a, b in zip(y, k3, strict=True)))
        y = tuple(a + h / 6.0 * (b + 2.0 * c + 2.0 * d + e) for a, b, c, d, e in zip(y, k1, k2, k3, k4, strict=True))
    return np.array(result)


def _coordinates(y: tuple[float, ...]) -> list[float]:
    (sr, sp, sy), (cr, cp, cy) = ([f(a) for a in y[:3]] for f in (math.sin, math.cos))
    return [
        cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr,
        sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr,
        -sp, cp * sr, cp * cr, *y[3:],
    ]  # fmt: skip


def run() -> CaseResult:
    """Measure the angular momentum in the world, which is constant without torque."""
    ours = drift(
        momentum(run_fixed_steps("rkmk4", FreeBodyParameters(INERTIA), initial_state(OFFSET), DURATION, STEPS, SAMPLES))
    )
    baseline = drift(momentum(euler_angles(OFFSET, STEPS // 4, SAMPLES)))
    t = np.linspace(0.0, DURATION, SAMPLES + 1)
    row = Row("momentum", "rkmk4 on SO(3), 1 ms", "change of the angular momentum in the world, relative", BOUND, WHY,
              float(ours.max()), "RK4 on Euler angles, 4 ms", float(baseline.max()))  # fmt: skip
    return CaseResult(
        [row],
        Plot("time [s]", "change of momentum", [Curve("rkmk4", t, ours), Curve("Euler angles", t, baseline)], BOUND),
    )


def sweep() -> Sweep:
    """Decrease the distance to the pole."""
    offsets = np.geomspace(10.0, 1e-6, 15)
    ours = [
        drift(
            momentum(run_fixed_steps("rkmk4", FreeBodyParameters(INERTIA), initial_state(a), DURATION, STEPS, 60))
        ).max()
        for a in offsets
    ]
    baseline = [drift(momentum(euler_angles(a, STEPS // 6, 100))).max() for a in offsets]
    curves = [
        Curve("rkmk4 on SO(3)", offsets, np.array(ours)),
        Curve("RK4 on Euler angles", offsets, np.array(baseline)),
    ]
    return Sweep("roll and yaw rate [rad/s]", "change of momentum", 1e-3, curves, falling=True)
