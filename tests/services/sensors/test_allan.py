"""Noise of every preset against its stated values by Allan deviation, at several sample rates."""

import math

import numpy as np
import pytest
from record import REST, allan_deviation, record, rms_of_axes

from lapwing.services.sensors import error_models, gps, imu, schema
from lapwing.services.sensors.barometer import PRESETS as BAROMETERS
from lapwing.services.sensors.magnetometer import PRESETS as MAGNETOMETERS
from lapwing.services.sensors.sonar import PRESETS as SONARS

DPS = math.radians(1.0)
MG = 1e-3 * 9.80665
IMUS = {name: p for name, p in imu.PRESETS.items() if name != "ideal"}
GPSS = {name: p for name, p in gps.PRESETS.items() if name != "ideal"}


def at_peak(sensor, p, correlation_time, samples=1_000_000):
    """Return the Allan deviation at the cluster time at which that of the bias walk has its peak."""
    m = 40
    p = p._replace(rate=m / (error_models.ALLAN_PEAK_TIME * correlation_time))
    return allan_deviation(record(sensor, p, samples), m)


@pytest.mark.parametrize("name", IMUS)
def test_imu_white_noise_is_stated_density(name):
    """At the preset's rate and resolution: n / sqrt(2 tau) for a one-sided density n."""
    p = IMUS[name]._replace(warm_up_rise=0.0)
    m = 25
    tau = m / p.rate
    deviation = allan_deviation(record("imu", p, 100_000), m)
    gyro, force = p.gyro.noise_dps_per_sqrt_hz * DPS, p.accelerometer.noise_mg_per_sqrt_hz * MG
    assert rms_of_axes(deviation[:3]) == pytest.approx(gyro / math.sqrt(2 * tau), rel=0.05)
    assert rms_of_axes(deviation[3:]) == pytest.approx(force / math.sqrt(2 * tau), rel=0.05)


def test_stated_random_walk_of_mpu6000():
    """0.30 deg/sqrt(h): the Allan deviation of the white noise, extrapolated to one hour, in deg/h."""
    x = record("imu", imu.MPU6000._replace(warm_up_rise=0.0), 100_000)
    m = 25
    at_one_hour = rms_of_axes(allan_deviation(x, m)[:3]) * math.sqrt(m / 250.0 / 3600.0)
    assert at_one_hour / DPS * 3600.0 == pytest.approx(0.30, rel=0.05)


@pytest.mark.parametrize("name", IMUS)
def test_imu_bias_instability_is_stated_value(name):
    p = IMUS[name]
    p = p._replace(
        warm_up_rise=0.0,
        gyro=p.gyro._replace(resolution_dps=0.0),  # at one sample a minute rounding would hide the noise
        accelerometer=p.accelerometer._replace(resolution_mg=0.0),
    )
    deviation = at_peak("imu", p, p.gyro.bias_correlation_time)
    assert rms_of_axes(deviation[:3]) == pytest.approx(p.gyro.bias_instability_deg_per_h * DPS / 3600.0, rel=0.05)
    assert rms_of_axes(deviation[3:]) == pytest.approx(p.accelerometer.bias_instability_ug * 1e-3 * MG, rel=0.05)


def white(sensor, p, density, columns):
    m = 5
    deviation = rms_of_axes(allan_deviation(record(sensor, p, 100_000), m)[columns])
    return deviation / (density / math.sqrt(2 * m / p.rate))


@pytest.mark.parametrize("name", ["rm3100", "hmc5883l"])
def test_magnetometer_noise_is_that_of_preset(name):
    p = MAGNETOMETERS[name]
    fine = p._replace(resolution_nt=0.0)
    assert white("magnetometer", fine, p.noise_nt_per_sqrt_hz * 1e-9, slice(3)) == pytest.approx(1.0, rel=0.05)
    quiet = fine._replace(noise_nt_per_sqrt_hz=0.0)
    assert rms_of_axes(at_peak("magnetometer", quiet, p.bias_correlation_time)) == pytest.approx(
        p.bias_instability_nt * 1e-9, rel=0.05
    )


def test_barometer_noise_is_that_of_preset():
    p = BAROMETERS["ms5611"]
    fine = p._replace(resolution_pa=0.0)
    assert white("barometer", fine, p.noise_pa_per_sqrt_hz, slice(1)) == pytest.approx(1.0, rel=0.05)
    assert rms_of_axes(at_peak("barometer", fine, p.bias_correlation_time)) == pytest.approx(
        p.bias_instability_pa, rel=0.05
    )
    assert 1.0 <= p.noise_pa_per_sqrt_hz * math.sqrt(p.rate / 2) <= 3.0  # [Pa] in samples at 20 to 50 Hz


def test_sonar_noise_is_that_of_preset():
    p = SONARS["mb1202"]._replace(resolution=0.0)
    assert white("sonar", p, p.noise_m_per_sqrt_hz, slice(1)) == pytest.approx(1.0, rel=0.05)


@pytest.mark.long
@pytest.mark.parametrize("name", GPSS)
def test_gps_noise_is_that_of_preset(name):
    p = GPSS[name]
    still = p._replace(correlated_error_horizontal=0.0, correlated_error_vertical=0.0)
    assert white("gps", still, p.noise_horizontal_m_per_sqrt_hz, slice(2)) == pytest.approx(1.0, rel=0.05)
    assert white("gps", still, p.noise_vertical_m_per_sqrt_hz, slice(2, 3)) == pytest.approx(1.0, rel=0.05)
    assert white("gps", still, p.noise_velocity_m_per_s_per_sqrt_hz, slice(3, 6)) == pytest.approx(1.0, rel=0.05)
    deviation = at_peak("gps", p, p.correlation_time)
    assert rms_of_axes(deviation[:2]) == pytest.approx(
        error_models.ALLAN_PEAK * p.correlated_error_horizontal, rel=0.05
    )
    assert rms_of_axes(deviation[2:3]) == pytest.approx(error_models.ALLAN_PEAK * p.correlated_error_vertical, rel=0.05)


@pytest.mark.parametrize("rate", [50.0, 200.0, 1000.0])
def test_noise_density_is_independent_of_rate(rate):
    p = imu.BMI088
    p = p._replace(rate=rate, warm_up_rise=0.0, gyro=p.gyro._replace(resolution_dps=0.0))
    tau = 0.1
    deviation = rms_of_axes(allan_deviation(record("imu", p, round(400 * rate)), round(tau * rate))[:3])
    assert deviation == pytest.approx(p.gyro.noise_dps_per_sqrt_hz * DPS / math.sqrt(2 * tau), rel=0.05)


@pytest.mark.parametrize("rate", [0.05, 0.2])
def test_bias_walk_is_independent_of_rate(rate):
    p = imu.Imu(gyro=imu.Gyro(bias_instability_deg_per_h=4.6, bias_correlation_time=100.0), rate=rate)
    m = round(error_models.ALLAN_PEAK_TIME * 100.0 * rate)
    deviation = rms_of_axes(allan_deviation(record("imu", p, 300_000), m)[:3])
    # With nine or more samples per cluster their mean is the mean of the cluster within 1 %.
    assert deviation == pytest.approx(4.6 * DPS / 3600.0, rel=0.05)


def test_every_noise_has_mean_zero():
    """Within four standard errors, without the bias walk, whose mean converges over hours."""
    sensors = {
        "imu": imu.Imu(gyro=imu.Gyro(noise_dps_per_sqrt_hz=0.01), accelerometer=imu.Accelerometer(0.2)),
        "magnetometer": MAGNETOMETERS["ideal"]._replace(noise_nt_per_sqrt_hz=30.0),
        "barometer": BAROMETERS["ideal"]._replace(noise_pa_per_sqrt_hz=0.3),
        "gps": gps.Gps(0.003, 0.005, 0.02),
    }
    for name, p in sensors.items():
        ideal = record(name, schema.sensors()[name].PRESETS["ideal"], 1)[0]
        error = record(name, p, 50_000) - ideal
        mean, standard_error = error.mean(axis=0), error.std(axis=0) / math.sqrt(len(error))
        assert np.all(np.abs(mean) < 4 * standard_error), name


def test_biases_have_mean_zero_and_stated_spread_over_vehicles():
    p = imu.Imu(gyro=imu.Gyro(turn_on_bias_dps=0.1), accelerometer=imu.Accelerometer(turn_on_bias_mg=3.0))
    first = np.array([record("imu", p, 1, seed=seed)[0] for seed in range(600)])
    first[:, 5] -= REST.environment.gravity
    spread = np.array([0.1 * DPS] * 3 + [3.0 * MG] * 3)
    assert np.all(np.abs(first.mean(axis=0)) < 4 * spread / math.sqrt(600))
    np.testing.assert_allclose(first.std(axis=0), spread, rtol=4 / math.sqrt(2 * 600))


def test_streams_are_independent():
    """Across axes, sensors, vehicles and seeds: correlation zero within 4.5 standard errors."""
    n = 20_000
    noisy = imu.Imu(gyro=imu.Gyro(noise_dps_per_sqrt_hz=0.01), accelerometer=imu.Accelerometer(0.2))
    records = [record("imu", noisy, n, seed=s, vehicle=v) for s, v in ((1, "drone1"), (2, "drone1"), (1, "drone2"))]
    records.append(record("gps", gps.Gps(0.003, 0.005, 0.02), n))
    records.append(record("magnetometer", MAGNETOMETERS["ideal"]._replace(noise_nt_per_sqrt_hz=30.0), n))
    x = np.hstack(records)
    correlation = np.corrcoef(x.T) - np.eye(x.shape[1])
    assert np.abs(correlation).max() < 4.5 / math.sqrt(n)
