"""Tracking errors, separation of vehicles, and reproduction of results."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from lapwing.cosim.config import provenance
from lapwing.flights import tracking
from lapwing.flights.logs import log_comparison
from lapwing.flights.separation import least_over_time, nearest


def test_roll_pitch_yaw_equal_scipy():
    some = Rotation.random(100, random_state=np.random.default_rng(3))
    result, expected = tracking.roll_pitch_yaw(some.as_quat()), some.as_euler("ZYX")[:, ::-1]
    assert result[:, :2] == pytest.approx(expected[:, :2], abs=1e-7)  # asin is steep near 90 degrees
    assert np.cos(result[:, 2] - expected[:, 2]) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.0, "0"), (12.345678, "12.3457"), (0.01, "0.0100"), (-2.136e-4, "-0.000214"), (3.2e-6, "0.00000320"),
     (3.2745e-9, "3.27e-09"), (float("nan"), "nan")],
)  # fmt: skip
def test_small_errors_have_significant_digits(value, text):
    assert tracking.digits(value) == text


def test_angle_differences_are_wrapped():
    reference, attitude = np.zeros((3, 6)), np.zeros((3, 3))
    reference[:, 5] = (0.1, 3.0, -3.0)
    attitude[:, 2] = (0.3, -3.0 - 4.0 * np.pi, 3.0)
    reference[:, 0] = (1.0, 2.0, 3.0)
    result = tracking.errors(reference, np.zeros((3, 3)), attitude, np.array([True, True, True]))
    assert result[:, 5] == pytest.approx([-0.2, 6.0 - 2.0 * np.pi, 2.0 * np.pi - 6.0])
    assert result[:, 0].tolist() == [1.0, 2.0, 3.0]
    assert len(tracking.errors(reference, np.zeros((3, 3)), attitude, np.array([True, False, True]))) == 2


def test_errors_are_bit_for_bit_those_of_numpy():
    random = np.random.default_rng(5)
    reference, position, attitude = (random.normal(size=(500, k)) * 9.0 for k in (6, 3, 3))
    armed = random.random(500) > 0.3
    turn = reference[:, 3:] - attitude
    turn -= tracking.TURN * np.round(turn / tracking.TURN)
    expected = np.column_stack([reference[:, :3] - position, turn])[armed]
    assert np.array_equal(tracking.errors(reference, position, attitude, armed), expected)
    assert np.array_equal(tracking.errors(reference, position.T.copy().T, attitude, armed), expected)  # other layout


def test_yaw_is_continuous_over_half_turn():
    yaw = np.linspace(0.0, 9.0, 50)
    xyzw = np.column_stack([np.zeros((50, 2)), np.sin(0.5 * yaw), np.cos(0.5 * yaw)])
    assert tracking.roll_pitch_yaw(xyzw)[:, 2] == pytest.approx(yaw)
    assert tracking.roll_pitch_yaw(xyzw[:17])[:, 2] == pytest.approx(yaw[:17])  # no jump


class Truth:
    """Return a straight path."""

    def __init__(self, start, velocity, n=11):
        self.times = np.arange(n) * 0.1
        self.position = np.array(start) + self.times[:, None] * np.array(velocity)

    def __len__(self):
        return len(self.times)


def test_passing_vehicles_are_nearest_side_by_side():
    truths = {
        "a": Truth((0.0, 0.0, 0.0), (2.0, 0.0, 0.0)),
        "b": Truth((1.0, 3.0, 0.0), (0.0, 0.0, 0.0)),
        "far": Truth((0.0, 90.0, 0.0), (0.0, 0.0, 0.0), n=6),  # shorter log
    }
    result = nearest(truths)
    assert (result.vehicles, result.distance, result.time) == (("a", "b"), pytest.approx(3.0), pytest.approx(0.5))
    assert str(result) == "Nearest: a and b, 3.00 m apart at 0.50 s"
    assert least_over_time(truths) == pytest.approx(np.hypot(3.0, 1.0 - 2.0 * np.arange(6) * 0.1))


RECORDED = {"commit": "abc", "mode": "single-process"}


@pytest.mark.parametrize(
    ("metadata", "here", "beginning"),
    [
        (RECORDED, "abc", "equal"),
        (RECORDED, "def", "not certain"),
        (RECORDED, "abc+", "unknown"),
        ({"mode": "single-process"}, "abc", "unknown"),
        ({**RECORDED, "mode": "imported"}, "abc", "imported"),
    ],
)
def test_expectation_follows_from_commits(monkeypatch, metadata, here, beginning):
    monkeypatch.setattr(log_comparison, "source_commit", lambda: here)
    assert log_comparison.expectation(metadata).startswith(beginning)


def test_facts_name_this_machine():
    facts = {fact.name: fact for fact in log_comparison.facts({**provenance.machine(), "processor": "armv9"})}
    assert facts["python"].recorded == facts["python"].here
    assert facts["processor"].recorded != facts["processor"].here
    assert facts["commit"].recorded == "unknown"
