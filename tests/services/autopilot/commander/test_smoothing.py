"""Position smoothing: the setpoint arrives, stops, and respects its limits."""

import math

import numpy as np
import pytest

from lapwing.services.autopilot.commander.smoothing import Limits, PositionSmoothing, braking_speed, wrap_angle

LIMITS = Limits(horizontal=5.0, up=3.0, down=1.5, acceleration=2.0, jerk=8.0, yaw_rate=0.8)
DT = 0.004


def moved_setpoint(target, seconds, limits=LIMITS, start=(0.0, 0.0, 10.0), velocity=(0.0, 0.0, 0.0)):
    """Return positions, velocities and accelerations, each (n, 3)."""
    smoothing = PositionSmoothing(start, 0.0, velocity)
    rows = []
    for _ in range(round(seconds / DT)):
        smoothing.move_to(target, limits, DT)
        rows.append((smoothing.position, smoothing.velocity, smoothing.acceleration))
    return np.array(rows).transpose(1, 0, 2)


@pytest.mark.parametrize("target", [(30.0, 0.0, 10.0), (3.0, -4.0, 2.0), (0.2, 0.1, 10.3), (0.0, 0.0, 40.0)])
def test_smoothing_has_no_overshoot_and_keeps_limits(target):
    p, v, a = moved_setpoint(target, 40.0)
    assert p[-1] == pytest.approx(target, abs=1e-3)
    assert np.linalg.norm(v[-1]) < 1e-3
    assert np.hypot(v[:, 0], v[:, 1]).max() <= 5.0 * 1.01
    assert v[:, 2].max() <= 3.0 * 1.01
    assert v[:, 2].min() >= -1.5 * 1.01
    assert np.linalg.norm(a, axis=1).max() <= 2.0 + 1e-9
    assert np.linalg.norm(np.diff(a, axis=0), axis=1).max() <= 8.0 * DT + 1e-9
    way = np.array(target) - (0.0, 0.0, 10.0)
    assert ((p - (0.0, 0.0, 10.0)) @ way / (way @ way)).max() < 1.0 + 0.02 / np.linalg.norm(way)


def test_velocity_and_acceleration_are_derivatives():
    p, v, a = moved_setpoint((10.0, 5.0, 12.0), 8.0)
    assert np.diff(p, axis=0) / DT == pytest.approx((v[1:] + v[:-1]) / 2.0, abs=1e-3)
    assert np.diff(v, axis=0) / DT == pytest.approx((a[1:] + a[:-1]) / 2.0, abs=1e-9)


def test_smoothing_stops_from_full_speed():
    p, _, _ = moved_setpoint((0.0, 0.0, 10.0), 20.0, velocity=(5.0, 0.0, 0.0))
    assert p[-1] == pytest.approx((0.0, 0.0, 10.0), abs=1e-3)
    assert p[:, 0].max() < 25.0 / 2.0 / 2.0 + 5.0


def test_yaw_setpoint_turns_by_shortest_angle():
    smoothing = PositionSmoothing((0.0, 0.0, 1.0), 3.0)
    for _ in range(2000):
        smoothing.turn_to(-3.0, LIMITS, DT)
        assert abs(smoothing.yaw_rate) <= 0.8
    assert smoothing.yaw == pytest.approx(2.0 * math.pi - 3.0, abs=1e-3)
    assert wrap_angle(smoothing.yaw) == pytest.approx(-3.0, abs=1e-3)


def test_speed_of_approach_has_no_step():
    bend = 1.0
    assert braking_speed(bend - 1e-9, 2.0) == pytest.approx(braking_speed(bend + 1e-9, 2.0), abs=1e-6)
