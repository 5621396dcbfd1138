"""Filter against closed forms and independent linear algebra; accuracy and consistency over many flights."""

import math

import estimator_flight as ef
import numpy as np
import pytest
from scipy.stats import chi2

from lapwing.dynamics.environment import STANDARD
from lapwing.dynamics.lie.quaternion import (
    NO_ROTATION,
    exp,
    from_roll_pitch_yaw,
    multiply,
    rotate_back,
    rotation_matrix,
)
from lapwing.dynamics.vector import ZERO
from lapwing.services.autopilot import estimator
from lapwing.services.autopilot.estimator import covariance_inflation, filter_state, fuse
from lapwing.services.autopilot.estimator.covariance_propagation import propagate_considered, propagate_covariance
from lapwing.services.sensors.error_models import scale_and_misalignment

pytestmark = pytest.mark.long

P = estimator.PRESETS["rtk"]
SEEDS = 100


def at_rest(attitude=NO_ROTATION, p=P):
    force = rotate_back(attitude, (0.0, 0.0, p.gravity))
    return estimator.initial(
        p, estimator.new_memory(), ZERO, force, rotate_back(attitude, STANDARD.magnetic_field_world)
    )


@pytest.mark.parametrize("angles", [(0.0, 0.0, 0.0), (0.1, -0.2, 2.5), (-0.4, 0.3, -1.0), (0.0, 0.0, math.pi / 2)])
def test_levelled_attitude(angles):
    attitude = from_roll_pitch_yaw(*angles)
    levelled = at_rest(attitude).nominal.attitude
    np.testing.assert_allclose(rotation_matrix(levelled), rotation_matrix(attitude), atol=1e-14)


def test_prediction_follows_turning_climb():
    """Constant world acceleration at a constant rate of rotation: exact except for the trapezoidal rule."""
    omega, acceleration = (0.0, 0.0, 0.8), (1.0, -0.5, 0.3)
    s = at_rest()
    for tick in range(501):
        attitude = exp((0.0, 0.0, 0.8 * tick * P.interval))
        force = rotate_back(attitude, (*acceleration[:2], acceleration[2] + P.gravity))
        if tick:
            s = estimator.predict(P, s, omega, force, 0.0, 0.0, True)
        else:
            s = s._replace(inertial=s.inertial._replace(tick=1, omega=omega, force=force))
    t = 500 * P.interval
    np.testing.assert_allclose(s.nominal.velocity_world, np.multiply(acceleration, t), atol=1e-9)
    np.testing.assert_allclose(s.nominal.position_world, np.multiply(acceleration, t * t / 2), atol=1e-9)
    np.testing.assert_allclose(s.nominal.attitude, exp((0.0, 0.0, 0.8 * t)), atol=1e-12)


def random_covariance(rng):
    a = rng.normal(size=(filter_state.SIZE, filter_state.SIZE))
    return a @ a.T / filter_state.SIZE


def skew(v):
    return np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])


def test_covariance_propagation_against_dense_matrices():
    """theory, eq. (3.22), written out as F P F^T."""
    rng = np.random.default_rng(0)
    covariance, f, dt = random_covariance(rng), rng.normal(size=3), 0.01
    r = np.array(rotation_matrix(from_roll_pitch_yaw(0.3, -0.5, 2.0))).reshape(3, 3)
    a = np.zeros((filter_state.SIZE, filter_state.SIZE))
    a[0:3, 9:12] = -r
    a[3:6, 0:3] = -skew(f)
    a[3:6, 12:15] = -r
    a[6:9, 3:6] = np.eye(3)
    transition = np.eye(filter_state.SIZE) + dt * a
    ours = covariance.copy()
    propagate_covariance(ours, tuple(f), tuple(r.ravel()), dt)
    np.testing.assert_allclose(ours, transition @ covariance @ transition.T, atol=1e-13)
    np.testing.assert_array_equal(ours, ours.T)


def dense_joint(rng):
    """Return memory with a random joint covariance of errors and considered parameters, and that covariance."""
    m, n = at_rest().memory, filter_state.SIZE + filter_state.CONSIDERED
    a = rng.normal(size=(n, n))
    a[filter_state.SIZE :] = np.diag(rng.uniform(0.5, 2.0, filter_state.CONSIDERED)) @ np.eye(n)[filter_state.SIZE :]
    joint = a @ a.T  # the parameters are independent of each other
    m.covariance[:] = joint[: filter_state.SIZE, : filter_state.SIZE]
    m.considered[: filter_state.SIZE] = joint[: filter_state.SIZE, filter_state.SIZE :]
    m.considered[filter_state.VARIANCE] = np.diag(joint)[filter_state.SIZE :]
    return m, joint


def test_considered_propagation_against_dense_matrices():
    """Joint covariance F P F^T for gyroscopes that read M omega, M of (3.14), and accelerometers that read M f."""
    rng = np.random.default_rng(2)
    m, joint = dense_joint(rng)
    n, f, omega, dt = len(joint), rng.normal(size=3), rng.normal(size=3), 0.01
    r = np.array(rotation_matrix(from_roll_pitch_yaw(0.3, -0.5, 2.0))).reshape(3, 3)
    a = np.zeros((n, n))
    a[0:3, 9:12] = -r
    a[3:6, 0:3] = -skew(f)
    a[3:6, 12:15] = -r
    a[6:9, 3:6] = np.eye(3)
    for k in range(6):
        draw = np.eye(6)[k]
        matrix = scale_and_misalignment(1.0, 1.0, tuple(draw[:3]), tuple(draw[3:]))
        wrong = (np.reshape(matrix, (3, 3)) - np.eye(3)) @ omega
        a[0:3, filter_state.SIZE + k] = -r @ wrong
    lift = np.array([0.0, 0.0, (f @ r)[2]])
    for k, (stretch, angles) in enumerate([((0, 0, 0), (0, 1, 0)), ((0, 0, 0), (-1, 0, 0)), ((0, 0, 1), (0, 0, 0))]):
        matrix = scale_and_misalignment(1.0, 1.0, tuple(map(float, stretch)), tuple(map(float, angles)))
        a[3:6, filter_state.SIZE + filter_state.LIFT + k] = -r @ (np.reshape(matrix, (3, 3)) - np.eye(3)) @ lift
    drift = 0.004
    for k in range(3):
        a[filter_state.GYRO + k, filter_state.SIZE + filter_state.DRIFT + k] = drift / dt
    transition = np.eye(n) + dt * a
    expected = transition @ joint @ transition.T
    propagate_covariance(m.covariance, tuple(f), tuple(r.ravel()), dt)
    propagate_considered(m, tuple(omega), tuple(f), tuple(r.ravel()), drift, dt)
    np.testing.assert_allclose(m.covariance, expected[: filter_state.SIZE, : filter_state.SIZE], atol=1e-13)
    np.testing.assert_allclose(
        m.considered[: filter_state.SIZE], expected[: filter_state.SIZE, filter_state.SIZE :], atol=1e-13
    )
    np.testing.assert_array_equal(m.covariance, m.covariance.T)


def test_warm_up_of_gyroscopes_against_closed_form():
    """The bias is b_0 - c exp(-t/T) with known T: at first c is a part of the unknown bias, in the end it has gone."""
    p = P._replace(gyro_bias_walk=0.0, gyro_warm_up_time=2.0)
    s = at_rest(p=p)
    turn_on = p.gyro_bias_std**2 - p.gyro_warm_up_std**2
    for tick in range(1, 2001):
        s = estimator.predict(p, s, ZERO, (0.0, 0.0, p.gravity), 0.0, 0.0, True)
        if tick in (1, 500, 2000):
            left = np.exp(-tick * p.interval / p.gyro_warm_up_time)
            variance = np.diag(s.memory.covariance)[filter_state.GYRO :][:3]
            np.testing.assert_allclose(variance, turn_on + (left * p.gyro_warm_up_std) ** 2, rtol=1e-9)
            joint = s.memory.considered[filter_state.GYRO :, filter_state.DRIFT :][:3, :3]
            np.testing.assert_allclose(joint, -left * p.gyro_warm_up_std**2 * np.eye(3), atol=1e-18)


def test_considered_update_against_joseph_form():
    """Schmidt's gain does not change the parameters; Joseph's form of the joint covariance holds for any gain."""
    rng = np.random.default_rng(3)
    m, joint = dense_joint(rng)
    h, y, variance = rng.normal(size=len(joint)), 0.7, 0.3
    m.row[:], m.considered[filter_state.ROW] = h[: filter_state.SIZE], h[filter_state.SIZE :]
    nis = fuse.fuse(m, y, variance)
    s = h @ joint @ h + variance
    gain = np.where(np.arange(len(joint)) < filter_state.SIZE, joint @ h / s, 0.0)
    rest = np.eye(len(joint)) - np.outer(gain, h)
    expected = rest @ joint @ rest.T + variance * np.outer(gain, gain)
    assert nis == pytest.approx(y * y / s)
    np.testing.assert_allclose(m.correction, (gain * y)[: filter_state.SIZE], atol=1e-12)
    np.testing.assert_allclose(m.covariance, expected[: filter_state.SIZE, : filter_state.SIZE], atol=1e-11)
    np.testing.assert_allclose(
        m.considered[: filter_state.SIZE], expected[: filter_state.SIZE, filter_state.SIZE :], atol=1e-11
    )


def test_scalar_updates_one_by_one_equal_joint_update():
    """Three sequential rows against the textbook gain, and the sum of their ratios against the joint NIS."""
    rng = np.random.default_rng(1)
    m = at_rest().memory
    m.covariance[:] = random_covariance(rng)
    before = m.covariance.copy()
    h, y, variance = rng.normal(size=(3, filter_state.SIZE)), rng.normal(size=3), np.array([0.3, 0.5, 0.2])
    nis = 0.0
    for row, innovation, v in zip(h, y, variance, strict=True):
        m.row[:] = row
        nis += fuse.fuse(m, innovation, v)
    s = h @ before @ h.T + np.diag(variance)
    gain = before @ h.T @ np.linalg.inv(s)
    np.testing.assert_allclose(m.correction, gain @ y, atol=1e-10)
    np.testing.assert_allclose(m.covariance, before - gain @ s @ gain.T, atol=1e-10)
    assert nis == pytest.approx(y @ np.linalg.solve(s, y))


@pytest.mark.parametrize("axis", range(3))
def test_rows_of_acceleration_against_differences(axis):
    """The row is the change of the true acceleration by a small rotation of the estimate and a bias."""
    attitude, force = from_roll_pitch_yaw(0.3, -0.2, 1.0), np.array([0.4, -0.3, 9.0])
    m = at_rest().memory
    fuse.clear(m)
    r = np.array(rotation_matrix(attitude)).reshape(3, 3)
    fuse.acceleration_row(m, tuple(r @ force), tuple(r.ravel()), axis, 1.0)
    h = 1e-6
    for i in range(3):
        small = np.eye(3)[i] * h
        rotation = np.array(rotation_matrix(multiply(exp(tuple(small)), attitude))).reshape(3, 3)
        assert m.row[filter_state.THETA + i] == pytest.approx((rotation @ force - r @ force)[axis] / h, abs=1e-5)
        assert m.row[filter_state.ACCELEROMETER + i] == pytest.approx(
            (r @ (force - small) - r @ force)[axis] / h, abs=1e-5
        )
        assert m.considered[filter_state.ROW, filter_state.LIFT + i] == pytest.approx(
            (r @ (force - force[2] * small) - r @ force)[axis] / h, abs=1e-5
        )


def heading_innovation(attitude, iron):
    """Return the magnetometer's innovation for a level truth with heading north and a perturbed estimate."""
    s = at_rest()
    s = s._replace(nominal=s.nominal._replace(attitude=attitude, magnetometer_bias=iron))
    s.memory.covariance[:] = np.eye(filter_state.SIZE) * 1e-30
    s = estimator.update_magnetometer(P._replace(gate=1e30), s, STANDARD.magnetic_field_world, 1.0, True)
    return s.memory


def test_row_of_heading_against_differences():
    h = 1e-6
    row = heading_innovation(NO_ROTATION, ZERO).row.copy()
    bx, by, _ = STANDARD.magnetic_field_world

    def innovation(attitude, iron):
        f = np.array(rotation_matrix(attitude)).reshape(3, 3) @ np.subtract(STANDARD.magnetic_field_world, iron)
        return math.atan2(by, bx) - math.atan2(f[1], f[0])

    for i in range(3):
        small = np.eye(3)[i] * h
        # error theta of the estimate: the estimate is the truth rotated by -theta
        assert row[filter_state.THETA + i] == pytest.approx(innovation(exp(tuple(-small)), ZERO) / h, abs=1e-5)
        tesla = 1e-12
        change = innovation(NO_ROTATION, tuple(-np.eye(3)[i] * tesla)) / tesla
        assert row[filter_state.IRON + i] == pytest.approx(change, rel=1e-4, abs=1.0)


def test_considered_row_of_heading_against_differences():
    """Compare the change of the heading innovation by M of (3.14) with the row."""
    attitude = from_roll_pitch_yaw(0.3, -0.2, 1.0)
    true_body = np.array(rotate_back(attitude, STANDARD.magnetic_field_world))
    bx, by, _ = STANDARD.magnetic_field_world

    def turn(field):
        f = np.array(rotation_matrix(attitude)).reshape(3, 3) @ field
        return math.atan2(by, bx) - math.atan2(f[1], f[0])

    s = at_rest()
    s = s._replace(nominal=s.nominal._replace(attitude=attitude))
    s.memory.covariance[:] = np.eye(filter_state.SIZE) * 1e-30
    s.memory.considered[filter_state.VARIANCE] = 0.0
    m = estimator.update_magnetometer(P._replace(gate=1e30), s, tuple(true_body), 1.0, True).memory
    h = 1e-7
    for k in range(6):
        draw = np.eye(6)[k]
        matrix = scale_and_misalignment(h, h, tuple(draw[:3]), tuple(draw[3:]))
        change = turn(np.reshape(matrix, (3, 3)) @ true_body) / h
        row = m.considered[filter_state.ROW, filter_state.MAG_SCALE + k] if k < 5 else -m.row[filter_state.HEADING]
        assert row == pytest.approx(change, abs=1e-5), k


def ensemble(**arguments):
    """Return the flights of 100 seeds, stacked along a first axis."""
    flights = [ef.flight(seed=seed, **arguments) for seed in range(SEEDS)]
    return ef.Flight(*(np.array(part) for part in zip(*flights, strict=True)))


def rms(error):
    return np.sqrt(np.mean(error**2, axis=(0, 1)))


def test_rtk_position_error_is_below_three_centimetres():
    error = ensemble().error[:, 50:, ef.P]
    assert np.all(rms(error) < (0.015, 0.015, 0.01))
    assert np.mean(np.linalg.norm(error, axis=2) < 0.03) > 0.97


def test_estimator_flight_is_repeatable_bit_for_bit():
    for first, second in zip(ef.flight(seed=5, duration=8.0), ef.flight(seed=5, duration=8.0), strict=True):
        np.testing.assert_array_equal(first, second)


def share_within_bounds(values, degrees):
    """Return the share of instants with the mean over seeds within its 95 % bounds, and True if the total mean is."""
    low, high = chi2.ppf([0.025, 0.975], degrees * len(values)) / len(values)
    mean = values.mean(axis=0)
    return np.mean((mean > low) & (mean < high)), low < mean.mean() < high


def textbook():
    """Return sensors with only the modelled errors, and filter parameters that match them exactly."""
    i, m = ef.DEFAULT[0], ef.DEFAULT[1]
    exact = {"scale_error": 0.0, "misalignment_deg": 0.0}
    instruments = ef.sensor_parameters(
        imu=i._replace(
            gyro=i.gyro._replace(temperature_dps_per_k=0.0, **exact),
            accelerometer=i.accelerometer._replace(temperature_mg_per_k=0.0, **exact),
            warm_up_rise=0.0,
        ),
        magnetometer=m._replace(**exact),
    )
    p = P._replace(
        gyro_scale_std=0.0,
        gyro_alignment_std=0.0,
        gyro_bias_std=1.75e-3,
        gyro_bias_walk=2.28e-6,
        gyro_warm_up_std=0.0,
        accelerometer_bias_std=0.0294,
        accelerometer_bias_walk=3.6e-5,
        accelerometer_scale_std=0.0,
        accelerometer_alignment_std=0.0,
        magnetometer_bias_std=5.1e-8,
        magnetometer_bias_walk=5.1e-10,
        magnetometer_scale_std=0.0,
        magnetometer_alignment_std=0.0,
    )
    return {"instruments": instruments, "p": p}


def test_ideal_instruments_cause_no_estimate_error():
    """Zero variances are accepted, and repeated readings of a vehicle at rest do not count as stuck."""
    flight = ef.flight(
        instruments=ef.sensor_parameters(**{name: ef.sensors()[name].PRESETS["ideal"] for name in ef.NAMES})
    )
    assert np.abs(flight.error[10:, ef.P]).max() < 5e-3
    assert np.abs(flight.error[10:, ef.THETA]).max() < 1e-3
    assert not flight.health.any()


SETTLED = slice(30, None)  # in flight
DEGREES = {
    filter_state.GPS: 3,
    filter_state.GPS_VELOCITY: 3,
    filter_state.BARO: 1,
    filter_state.SONAR: 1,
    filter_state.MAG: 1,
}


@pytest.mark.parametrize("agility", [1.0, 2.0])
def test_filter_is_consistent_with_modelled_errors(agility):
    """NEES of attitude, velocity and position, and NIS of every source, within their 95 % bounds over 100 seeds."""
    flights = ensemble(agility=agility, **textbook())
    share, mean_inside = share_within_bounds(flights.nees[:, SETTLED], 9)
    assert mean_inside
    assert share > 0.75
    for source, degrees in DEGREES.items():
        share, mean_inside = share_within_bounds(flights.nis[:, SETTLED, source], degrees)
        assert mean_inside, source
        assert source == filter_state.SONAR or share > 0.9, source  # no echo above 5 m
    assert np.mean(flights.rejected > 0) < 1e-4


@pytest.mark.parametrize("agility", [1.0, 2.0])
def test_filter_is_consistent_on_presets(agility):
    """Consistency with all errors of the presets; scale and alignment are considered and not estimated."""
    flights = ensemble(agility=agility)
    _, mean_inside = share_within_bounds(flights.nees[:, SETTLED], 9)
    assert mean_inside
    for source, degrees in DEGREES.items():
        assert share_within_bounds(flights.nis[:, SETTLED, source], degrees)[1], source
    assert np.mean(np.abs(flights.error) < 3.0 * flights.std) > 0.99
    assert np.mean(flights.rejected > 0) < 1e-4


def test_standard_receiver_error_stays_within_three_sigma():
    instruments = ef.sensor_parameters(gps=ef.gps.STANDARD)
    flights = ensemble(instruments=instruments, p=estimator.PRESETS["standard"])
    error = flights.error[:, 20:, ef.P]
    assert np.mean(np.abs(error) < 3 * flights.std[:, 20:, ef.P]) > 0.99
    assert np.all(rms(error) < 2.6)
    assert np.mean(flights.rejected > 0) < 1e-4


def test_filter_is_accurate_without_gps_velocity():
    assert np.all(rms(ensemble(velocity=False).error[:, 50:, ef.P]) < (0.015, 0.015, 0.01))


@pytest.mark.parametrize(("signs", "inflates"), [((1, 1), True), ((1, -1), False)])
def test_small_innovations_of_one_sign_inflate_covariance(signs, inflates):
    """theory, eq. (3.64): a reading of 2.5 deviations is accepted, but ten such readings are a drift."""
    s, largest = at_rest(), 0.0
    for k in range(20):
        spread = math.sqrt(s.memory.covariance[filter_state.VELOCITY, filter_state.VELOCITY] + 0.05**2)
        x, y, z = s.nominal.velocity_world
        velocity = (x + 2.5 * signs[k % 2] * spread, y, z + 1e-6 * k)
        s = estimator.update_gps_velocity(P, s, velocity, 0.05**2, 0, True)
        largest = max(largest, math.sqrt(s.memory.covariance[filter_state.GYRO, filter_state.GYRO]))
    assert (largest > 2.0 * P.gyro_bias_std) == inflates


def test_rejected_reading_does_not_count_as_drift():
    s = at_rest()
    s = estimator.update_gps_velocity(P, s, (30.0, 0.0, 0.0), 0.05**2, 0, True)
    assert s.memory.rejected[filter_state.GPS_VELOCITY]
    before = s.memory.covariance[filter_state.GYRO, filter_state.GYRO]
    s = estimator.update_gps_velocity(P, s, (0.01, 0.0, 0.0), 0.05**2, 0, True)
    assert s.memory.covariance[filter_state.GYRO, filter_state.GYRO] <= before


def test_covariance_is_inflated_only_for_lasting_rejection():
    s = at_rest()
    before = s.memory.covariance.copy()
    s.memory.since[filter_state.MAG] = 100
    covariance_inflation.inflate_covariance(P, s.memory, filter_state.MAG)
    np.testing.assert_array_equal(s.memory.covariance, before)
    s.memory.since[filter_state.MAG] = 2600  # 10.4 s
    covariance_inflation.inflate_covariance(P, s.memory, filter_state.MAG)
    assert np.all(
        np.diag(s.memory.covariance)[filter_state.IRON : filter_state.IRON + 3] > np.diag(before)[filter_state.IRON]
    )
