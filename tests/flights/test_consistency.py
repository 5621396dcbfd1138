"""Normalised errors against closed forms, a textbook's bounds, and the estimator in wind and at touch-down."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import lapwing
from lapwing.flights import consistency
from lapwing.flights.metrics import metrics
from lapwing.flights.rotation_arrays import conjugate, from_xyzw, product, rotation_vector
from lapwing.services.autopilot.estimator.filter_state import SIZE
from tests.combinations import rest_nightly

HOVER = {
    "trajectory.phase": [
        {"name": "align", "duration": 2.0},
        {"name": "climb", "z": {"kind": "ramp", "to": 5.0, "rate": 1.0}},
        {"name": "hover", "duration": 40.0},
        {"name": "descend", "z": {"kind": "ramp", "to": 0.0, "rate": 1.0}},
        {"name": "land", "duration": 5.0},
    ]
}
GPS_LOSS = {"sensors.gps.faults": [{"kind": "dropout", "start": 30.0, "stop": 45.0}]}
WIND = {"effects.random_wind_force.mean": (9.0, 3.0, 0.0), "effects.random_wind_force.sigma": 3.0}


def test_bounds_equal_textbook_example():
    """Bar-Shalom, Li, Kirubarajan, example 5.4.3-1: 50 runs of two states, sum within 74.2 and 129.6."""
    assert consistency.bounds(2, 50) == pytest.approx((74.22 / 50, 129.56 / 50), rel=1e-4)


def test_nees_of_drawn_errors_has_chi_square_mean():
    random = np.random.default_rng(1)
    factor = random.normal(size=(9, 9)) * 10.0 ** np.linspace(-4, 1, 9)[:, None]
    error = random.normal(size=(20_000, 9)) @ factor.T
    values = consistency.nees(error, np.broadcast_to(factor @ factor.T, (20_000, 9, 9)))
    assert values.mean() == pytest.approx(9.0, abs=4 * np.sqrt(18 / 20_000))
    assert np.mean(values < 16.919) == pytest.approx(0.95, abs=0.006)


def test_joint_covariance_restores_upper_triangle():
    square = np.arange(SIZE * SIZE, dtype=float).reshape(SIZE, SIZE)
    square += square.T
    restored = consistency.joint_covariance(square[np.triu_indices(SIZE)][None])
    np.testing.assert_array_equal(restored[0], square[:9, :9])


def test_rotation_vector_equals_scipy():
    random = np.random.default_rng(2)
    before = Rotation.random(50, random_state=3)
    turn = random.normal(size=(50, 3)) * np.logspace(-9, 0, 50)[:, None]
    after = Rotation.from_rotvec(turn) * before
    result = rotation_vector(product(from_xyzw(after.as_quat()), conjugate(from_xyzw(before.as_quat()))))
    np.testing.assert_allclose(result, turn, rtol=1e-6, atol=1e-15)


def vertical_speed_sigmas(flight):
    """Return times after two seconds, and errors of the vertical velocity in standard deviations of the estimate."""
    e, t = flight.estimate, flight.truth
    rows = np.searchsorted(t.times, e.times - 1e-6)
    late = e.times > 2.0
    return e.times[late], np.abs((t.velocity[rows, 2] - e.velocity[:, 2]) / e.velocity_std[:, 2])[late]


@pytest.mark.long
@pytest.mark.parametrize(
    "overrides", rest_nightly(HOVER, {}, WIND, GPS_LOSS, keep=2), ids=["hover", "mission", "wind", "gps loss"]
)
def test_joint_nees_is_within_its_bounds(overrides):
    seeds = range(101, 201)  # one flight at a time: a hundred take 5 GB
    values = [metrics(lapwing.fly("delivery_mission", seed=seed, overrides=overrides))["nees"] for seed in seeds]
    low, high = consistency.bounds(consistency.JOINT, len(seeds))
    assert low < np.mean(values) < high


@pytest.mark.long
def test_touch_down_stays_within_stated_velocity_error():
    """An impact shorter than the interval of the IMU does not appear in any reading: these seeds had 100 sigma.

    A vehicle that hops while its motors ramp down after contact has up to 15 sigma, until it rests.
    """
    for seed in (4, 29, 40):
        flight = lapwing.fly("quad_x", seed=seed)
        times, sigmas = vertical_speed_sigmas(flight)
        assert sigmas[times < flight.outcome.time - 0.05].max() < 5.0
        assert sigmas.max() < 20.0
