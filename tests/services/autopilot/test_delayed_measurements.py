"""Delayed measurements: independent of disturbances after the measurement."""

import numpy as np
import pytest

from lapwing.dynamics.environment import STANDARD
from lapwing.dynamics.lie.quaternion import exp, multiply, rotation_matrix
from lapwing.dynamics.vector import ZERO
from lapwing.services.autopilot import estimator
from lapwing.services.autopilot.estimator import filter_state, fuse, gps_fusion
from lapwing.services.autopilot.estimator.gps_fusion import Noise

P = estimator.PRESETS["rtk"]
AGE = 25  # [ticks] delay of a fix: 0.1 s
REST = (0.0, 0.0, P.gravity)


def at_rest():
    return estimator.initial(P, estimator.new_memory(), ZERO, REST, STANDARD.magnetic_field_world)


def predict_ticks(s, ticks, force=REST):
    for _ in range(ticks):
        s = estimator.predict(
            P, s, ZERO, force, 0.0, 1e-4, True
        )  # no noise in the rates: equal readings do not count as stuck
    return s


def velocity_std(s):
    return np.sqrt(np.diag(s.memory.covariance)[filter_state.VELOCITY : filter_state.VELOCITY + 3])


def velocity_fix(s, velocity, tick):
    noise = 1e-6 * (tick % 7)  # no equal fixes, which would count as stuck
    return estimator.update_gps_velocity(P, s, (noise, noise, velocity + noise), 0.02**2, AGE, True)


@pytest.mark.long
def test_fix_before_impact_does_not_correct_impact():
    """The vehicle sinks at 1 m/s and stops; only one accelerometer reading shows it."""
    s = velocity_fix(predict_ticks(at_rest(), 100), 0.0, 0)
    assert np.all(velocity_std(s) < 0.05)
    s = predict_ticks(predict_ticks(predict_ticks(s, 10), 1, force=(0.0, 0.0, 78.0)), 4)  # clipped at 8 g
    before = velocity_std(s)
    assert np.all(before > 0.4)
    hit = velocity_fix(s, 0.0, 1)  # measured 0.1 s earlier, 0.08 s before the impact
    assert np.all(velocity_std(hit) > 0.99 * before)
    after = velocity_fix(predict_ticks(hit, 25), 1.0, 2)  # the first fix measured after it
    assert after.memory.rejected[filter_state.GPS_VELOCITY] == 0
    assert np.all(velocity_std(after) < 0.05)
    assert after.nominal.velocity_world[2] == pytest.approx(1.0, abs=0.01)


def random_memory(rng):
    m = at_rest().memory
    a = rng.normal(size=(filter_state.SIZE, filter_state.SIZE))
    m.covariance[:] = a @ a.T / filter_state.SIZE
    return m


@pytest.mark.parametrize("share", [0.0, 0.1, 1.0, 10.0])
def test_covariance_against_dense_matrices(share):
    """The row applies to the present error minus the noise since the measurement; both are correlated."""
    rng = np.random.default_rng(round(share * 10))
    m = random_memory(rng)
    m.row[:] = rng.normal(size=filter_state.SIZE)
    before, h, variance = m.covariance.copy(), m.row.copy(), 0.02
    since, force = Noise(0.8 * share, 0.3 * share, 0.2 * share, 0.05 * share, 0.02 * share), (7.0, 1.0, -2.0)
    block = h[[filter_state.VELOCITY, filter_state.POSITION]]
    now, noise = h @ before @ h, block @ np.array([[0.8, 0.3], [0.3, 0.2]]) @ block * share
    # 1^2 + 2^2: force components that an attitude error rotates onto the axis
    noise += (0.02 if block[1] > 0.0 else 0.05) * share * 5.0
    part = min(noise / now, 1.0)
    s, largest = gps_fusion.delayed_innovation_variances(m, 0, since, variance, force)
    assert s == pytest.approx(now * (1.0 - part) + variance)
    assert largest == pytest.approx(now + noise + variance)
    fuse.apply_update(m, 0.7, s)
    gain = before @ h * (1.0 - part) / s
    np.testing.assert_allclose(m.correction, gain * 0.7, atol=1e-10)
    rest, cross = np.eye(filter_state.SIZE) - np.outer(gain, h), np.outer(before @ h * part, gain)
    joseph = rest @ before @ rest.T + (now * part + variance) * np.outer(gain, gain) + rest @ cross + (rest @ cross).T
    np.testing.assert_allclose(m.covariance, joseph, atol=1e-10)
    np.testing.assert_array_equal(m.covariance, m.covariance.T)
    assert np.linalg.eigvalsh(m.covariance).min() > 0.0


def turning(s):
    """Predict the ticks of a delay, in which the horizontal force turns and the vertical force halves."""
    for k in range(AGE):
        a = 3.0 * k / AGE
        force = (4.0 * np.cos(a), 4.0 * np.sin(a), 10.0 - 0.2 * k)
        s = estimator.predict(P, s, (0.01 * k, 0.0, 0.0), force, 0.0, 1e-4, True)
    return s


def test_delayed_rows_are_invariant_to_constant_attitude_error():
    """Two filters at the same past position, one rotated by a small angle, predict the same delayed measurement."""
    theta = 1e-5 * np.array([1.0, -2.0, 0.5])
    one, other = predict_ticks(at_rest(), 100), predict_ticks(at_rest(), 100)
    rotated = multiply(exp(tuple(theta)), other.nominal.attitude)
    one, other = turning(one), turning(other._replace(nominal=other.nominal._replace(attitude=rotated)))
    off = np.zeros(filter_state.SIZE)
    off[filter_state.THETA : filter_state.THETA + 3] = theta
    for at, name in ((filter_state.VELOCITY, "velocity_world"), (filter_state.POSITION, "position_world")):
        off[at : at + 3] = np.subtract(getattr(other.nominal, name), getattr(one.nominal, name))
    _, _, delay, weighted, mean = gps_fusion._past(P, one, AGE)
    matrix = rotation_matrix(one.nominal.attitude)
    for row, force, at in (
        (gps_fusion.delayed_velocity_row, mean, filter_state.VELOCITY),
        (gps_fusion.delayed_position_row, weighted, filter_state.POSITION),
    ):
        for axis in range(3):
            row(one.memory, force, matrix, axis, delay)
            assert one.memory.row @ off == pytest.approx(0.0, abs=1e-3 * np.abs(off[at : at + 3]).max())


def test_attitude_noise_is_weighted_by_remaining_delay():
    """Gyroscope noise of the last ticks hardly affects a delayed fix; that of the first ticks does."""
    s = at_rest()
    for k in range(AGE):
        rate = (0.0, 0.0, 1e-9 * k)  # no equal readings
        s = estimator.predict(P, s, rate, REST, 1e-2 if k == 4 else 0.0, 1e-12, True)
    since, noise = gps_fusion._noise_since(P, s, AGE), (P.interval * 0.1) ** 2
    left = (AGE - (AGE - 1 - 4)) * P.interval  # part of the delay before the fifth tick
    assert since.attitude_velocity == pytest.approx(noise * left**2, rel=1e-3)
    assert since.attitude_position == pytest.approx(noise * left**4 / 4.0, rel=1e-3)


def test_exact_past_measurement_leaves_only_later_noise():
    m = at_rest().memory
    m.covariance[:] = np.eye(filter_state.SIZE)
    m.row[:] = 0.0
    m.row[filter_state.VELOCITY + 1] = 1.0
    s, _ = gps_fusion.delayed_innovation_variances(m, 1, Noise(0.25, 0.0, 0.0, 0.0, 0.0), 0.0, REST)
    fuse.apply_update(m, 0.3, s)
    assert m.covariance[filter_state.VELOCITY + 1, filter_state.VELOCITY + 1] == pytest.approx(0.25)
