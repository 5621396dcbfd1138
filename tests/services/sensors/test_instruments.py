"""Ideal and imperfect readings against closed forms: signs, frames, saturation, rounding, range, latency."""

import math

import numpy as np
import pytest

from dynamics.geodesy import MAGNETIC_FIELD_WORLD, Home, air_pressure, enu_to_geodetic
from dynamics.lie.quaternion import NO_ROTATION, from_roll_pitch_yaw
from dynamics.noise import stream_key
from dynamics.vector import ZERO
from services.sensors import barometer, gps, imu, magnetometer, sonar
from services.sensors.truth import Truth

KEY = stream_key(7, "drone1", "test")
G = 9.81


def truth(position=ZERO, attitude=NO_ROTATION, velocity=ZERO, omega=ZERO, acceleration=ZERO, height=2.0):
    return Truth(position, attitude, velocity, omega, acceleration, height, G, Home(), 15.0, MAGNETIC_FIELD_WORLD)


def read(module, p, *truths):
    """The last of the readings of successive truths."""
    s = module.initial(p, KEY, truths[0])
    for tick, now in enumerate(truths):
        s, reading = module.sample(p, s, KEY, tick, now)
    return reading


def test_imu_reads_plus_g_along_z_at_rest_and_nothing_in_free_fall():
    assert read(imu, imu.Imu(), truth()).specific_force_body == (0.0, 0.0, G)
    assert read(imu, imu.Imu(), truth(acceleration=(0.0, 0.0, -G))).specific_force_body == (0.0, 0.0, 0.0)


def test_imu_measures_in_the_body_frame():
    """Nose down by 30 degrees (positive pitch in FLU): gravity's reaction leans towards -x of the body."""
    reading = read(imu, imu.Imu(), truth(attitude=from_roll_pitch_yaw(0.0, math.pi / 6, 1.0), omega=(0.1, 0.2, 0.3)))
    np.testing.assert_allclose(reading.specific_force_body, (-0.5 * G, 0.0, G * math.cos(math.pi / 6)), atol=1e-12)
    assert reading.omega_body == (0.1, 0.2, 0.3)
    ahead = read(
        imu, imu.Imu(), truth(attitude=from_roll_pitch_yaw(0.0, 0.0, math.pi / 2), acceleration=(0.0, 2.0, 0.0))
    )
    np.testing.assert_allclose(ahead.specific_force_body, (2.0, 0.0, G), atol=1e-12)


def test_imu_saturates_and_rounds():
    p = imu.Imu(imu.Gyro(range_dps=100.0, resolution_dps=0.5), imu.Accelerometer(range_g=2.0, resolution_mg=1.0))
    reading = read(
        imu, p, truth(omega=(math.radians(250.0), math.radians(-250.0), math.radians(1.3)), acceleration=(0, 0, 50.0))
    )
    np.testing.assert_allclose(np.degrees(reading.omega_body), (100.0, -100.0, 1.5), atol=1e-9)
    assert reading.specific_force_body[2] == pytest.approx(2.0 * 9.80665)
    assert reading.omega_variance == pytest.approx(math.radians(0.5) ** 2 / 12)


def test_imu_scale_and_misalignment_have_the_stated_size():
    """Turning about x at 1 rad/s: x shows the scale error, y and z the misalignment; over 400 units."""
    p = imu.Imu(imu.Gyro(scale_error=0.01, misalignment_deg=0.5))
    turning = truth(omega=(1.0, 0.0, 0.0))
    readings = []
    for seed in range(400):
        key = stream_key(seed, "drone1", "imu")
        readings.append(imu.sample(p, imu.initial(p, key, turning), key, 0, turning)[1].omega_body)
    spread = np.std(np.array(readings) - (1.0, 0.0, 0.0), axis=0)
    np.testing.assert_allclose(spread, (0.01, math.radians(0.5), math.radians(0.5)), rtol=0.15)


def test_imu_warms_up():
    """The bias of the cold start fades with the time constant of the warm-up."""
    p = imu.Imu(imu.Gyro(temperature_dps_per_k=1.0), warm_up=10.0, warm_up_time=1.0, rate=100.0)
    first = np.array(read(imu, p, truth()).omega_body)
    later = np.array(read(imu, p, *[truth()] * 101).omega_body)
    np.testing.assert_allclose(later, first * 0.99**100, rtol=1e-9)
    assert np.all(np.abs(first) > 0)


def test_magnetometer_turns_with_the_body():
    """Heading north (yaw 90 degrees in ENU), the body's x axis reads the north component."""
    east, north, up = MAGNETIC_FIELD_WORLD
    reading = read(
        magnetometer, magnetometer.Magnetometer(), truth(attitude=from_roll_pitch_yaw(0.0, 0.0, math.pi / 2))
    )
    np.testing.assert_allclose(reading.field_body, (north, -east, up), atol=1e-18)


def test_barometer_reads_the_pressure_law_and_falls_with_height():
    low = read(barometer, barometer.Barometer(), truth())
    high = read(barometer, barometer.Barometer(), truth(position=(0.0, 0.0, 10.0)))
    assert low.pressure == pytest.approx(air_pressure(Home().height, 15.0))
    assert high.pressure - low.pressure == pytest.approx(-1.19 * 9.81 * 10.0, rel=0.02)


def test_gps_gives_the_position_of_its_latency_ago():
    p = gps.Gps(latency_samples=2)
    path = [truth(position=(float(k), 2.0 * k, 0.5 * k), velocity=(10.0 * k, 0.0, 0.0)) for k in range(6)]
    reading = read(gps, p, *path)
    np.testing.assert_allclose(
        (reading.latitude_deg, reading.longitude_deg, reading.height),
        enu_to_geodetic(Home(), (3.0, 6.0, 1.5)),
        atol=1e-12,
    )
    assert reading.velocity_world == (30.0, 0.0, 0.0)
    assert reading.age == pytest.approx(0.2)


def test_gps_states_its_own_variance():
    for p in (gps.RTK, gps.STANDARD):
        reading = read(gps, p, truth())
        east, _, up = reading.position_variance
        assert east == pytest.approx(p.wander_horizontal**2 + p.noise_horizontal_m_per_sqrt_hz**2 * p.rate / 2)
        assert up == pytest.approx(p.wander_vertical**2 + p.noise_vertical_m_per_sqrt_hz**2 * p.rate / 2)
    rtk = read(gps, gps.RTK, truth()).position_variance
    assert 0.01 < math.sqrt(sum(rtk)) < 0.03  # about 2 cm
    assert math.sqrt(read(gps, gps.STANDARD, truth()).position_variance[0]) > 1.0


SONAR = sonar.Sonar(range_min=0.2, range_max=7.65, resolution=0.01, half_beam_deg=10.0, tilt_max_deg=25.0)


@pytest.mark.parametrize(
    ("height", "tilt_deg", "expected"),
    [
        (2.0, 0.0, 2.0),
        (2.0, 9.0, 2.0),  # the nearest ground is still within the beam
        (2.0, 20.0, round(2.0 / math.cos(math.radians(10.0)), 2)),
        (2.0, 26.0, math.inf),  # tilted too far: no echo
        (0.199, 0.0, 0.2),
        (0.19, 0.0, -math.inf),  # REP 117: detected, but too near
        (7.65, 0.0, 7.65),
        (7.66, 0.0, math.inf),
        (1.2345, 0.0, 1.23),
    ],
)
def test_sonar_range(height, tilt_deg, expected):
    reading = read(sonar, SONAR, truth(attitude=from_roll_pitch_yaw(math.radians(tilt_deg), 0.0, 0.4), height=height))
    assert reading.range == np.float32(expected)
    assert reading.valid


def test_same_key_and_tick_give_the_same_bits():
    s = imu.initial(imu.MPU6000, KEY, truth())
    assert imu.sample(imu.MPU6000, s, KEY, 5, truth()) == imu.sample(imu.MPU6000, s, KEY, 5, truth())
    assert imu.sample(imu.MPU6000, s, KEY, 5, truth()) != imu.sample(imu.MPU6000, s, KEY, 6, truth())
