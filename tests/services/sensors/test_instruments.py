"""Ideal and imperfect readings against closed forms: signs, frames, saturation, rounding, range, latency."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from lapwing.dynamics.atmosphere import pressure, pressure_altitude
from lapwing.dynamics.environment import STANDARD
from lapwing.dynamics.geodesy import enu_to_geodetic
from lapwing.dynamics.lie.quaternion import (
    NO_ROTATION,
    Quaternion,
    conjugate,
    exp,
    from_roll_pitch_yaw,
    log,
    multiply,
    rotate,
)
from lapwing.dynamics.noise import stream_key
from lapwing.dynamics.terrain import LEVEL, relief
from lapwing.dynamics.vector import ZERO
from lapwing.services.sensors import (
    airspeed,
    barometer,
    external_vision,
    gps,
    imu,
    magnetometer,
    optical_flow,
    rangefinder,
    sonar,
)
from lapwing.services.sensors.schema import parameters
from lapwing.services.sensors.sensor_inputs import Rotors, Truth

pytestmark = pytest.mark.usefixtures("uncompiled")

KEY = stream_key(7, "drone1", "test")
G = 9.81
FIELD = STANDARD.magnetic_field_world


def truth(position=ZERO, attitude=NO_ROTATION, velocity=ZERO, omega=ZERO, acceleration=ZERO, height=2.0, terrain=LEVEL):
    environment = STANDARD._replace(gravity=G, terrain=terrain)
    return Truth(position, attitude, velocity, omega, acceleration, height_above_ground=height, environment=environment)


def read(module, p, *truths):
    """Return the last reading of successive true states."""
    s = module.initial(p, KEY, truths[0])
    for tick, now in enumerate(truths):
        s, reading = module.sample(p, s, KEY, tick, now)
    return reading


def test_imu_reads_g_at_rest_and_zero_in_free_fall():
    assert read(imu, imu.Imu(), truth()).specific_force_body == (0.0, 0.0, G)
    assert read(imu, imu.Imu(), truth(acceleration=(0.0, 0.0, -G))).specific_force_body == (0.0, 0.0, 0.0)


def test_imu_measures_in_body_frame():
    """Nose down by 30 degrees (positive pitch in FLU): gravity's reaction leans towards -x of the body."""
    reading = read(imu, imu.Imu(), truth(attitude=from_roll_pitch_yaw(0.0, math.pi / 6, 1.0), omega=(0.1, 0.2, 0.3)))
    np.testing.assert_allclose(reading.specific_force_body, (-0.5 * G, 0.0, G * math.cos(math.pi / 6)), atol=1e-12)
    assert reading.omega_body == (0.1, 0.2, 0.3)
    ahead = read(
        imu, imu.Imu(), truth(attitude=from_roll_pitch_yaw(0.0, 0.0, math.pi / 2), acceleration=(0.0, 2.0, 0.0))
    )
    np.testing.assert_allclose(ahead.specific_force_body, (2.0, 0.0, G), atol=1e-12)


def test_external_vision_sees_the_pose():
    """Ideal: the true pose, also with the other sign of its quaternion, two samples late; noise of the stated size."""
    poses = [truth((k, 2.0, 3.0), from_roll_pitch_yaw(0.1, -0.2, 3.0 + 0.2 * k)) for k in range(4)]
    late = read(external_vision, external_vision.ExternalVision(latency_samples=2), *poses)
    assert late.position_world == (1.0, 2.0, 3.0)
    turn = multiply(conjugate(late.attitude), poses[1].attitude)
    np.testing.assert_allclose(np.abs(turn), (1.0, 0.0, 0.0, 0.0), atol=1e-12)
    noisy = external_vision.ExternalVision(0.01, 0.1, rate=50.0)
    s, readings = external_vision.initial(noisy, KEY, truth()), []
    for tick in range(2000):
        s, reading = external_vision.sample(noisy, s, KEY, tick, truth())
        readings.append((*reading.position_world, *log(reading.attitude)))
    deviation = np.std(readings, axis=0)
    np.testing.assert_allclose(deviation[:3], 0.05, rtol=0.06)  # 0.01 m/sqrt(Hz) sqrt(50 Hz / 2)
    np.testing.assert_allclose(deviation[3:], math.radians(0.5), rtol=0.06)
    assert reading.position_variance == pytest.approx(0.05**2)


def test_imu_saturates_and_rounds():
    p = imu.Imu(imu.Gyro(range_dps=100.0, resolution_dps=0.5), imu.Accelerometer(range_g=2.0, resolution_mg=1.0))
    reading = read(
        imu, p, truth(omega=(math.radians(250.0), math.radians(-250.0), math.radians(1.3)), acceleration=(0, 0, 50.0))
    )
    np.testing.assert_allclose(np.degrees(reading.omega_body), (100.0, -100.0, 1.5), atol=1e-9)
    assert reading.specific_force_body[2] == pytest.approx(2.0 * 9.80665)
    assert reading.omega_variance == pytest.approx(math.radians(0.5) ** 2 / 12)


def test_imu_scale_and_misalignment_have_stated_size():
    """Turning about x at 1 rad/s: x shows the scale error, y and z the misalignment; over 400 units."""
    p = imu.Imu(imu.Gyro(scale_error=0.01, misalignment_deg=0.5))
    turning = truth(omega=(1.0, 0.0, 0.0))
    readings = []
    for seed in range(400):
        key = stream_key(seed, "drone1", "imu")
        readings.append(imu.sample(p, imu.initial(p, key, turning), key, 0, turning)[1].omega_body)
    spread = np.std(np.array(readings) - (1.0, 0.0, 0.0), axis=0)
    np.testing.assert_allclose(spread, (0.01, math.radians(0.5), math.radians(0.5)), rtol=0.15)


def test_imu_bias_decays_during_warm_up():
    """The bias at the start decays with the time constant of the warm-up."""
    p = imu.Imu(imu.Gyro(temperature_dps_per_k=1.0), warm_up_rise=10.0, warm_up_time=1.0, rate=100.0)
    first = np.array(read(imu, p, truth()).omega_body)
    later = np.array(read(imu, p, *[truth()] * 101).omega_body)
    np.testing.assert_allclose(later, first * 0.99**100, rtol=1e-9)
    assert np.all(np.abs(first) > 0)


def test_magnetometer_turns_with_body():
    """Heading north (yaw 90 degrees in ENU), the body's x axis reads the north component."""
    east, north, up = FIELD
    reading = read(
        magnetometer, magnetometer.Magnetometer(), truth(attitude=from_roll_pitch_yaw(0.0, 0.0, math.pi / 2))
    )
    np.testing.assert_allclose(reading.field_body, (north, -east, up), atol=1e-18)


def test_barometer_reads_pressure_law_and_falls_with_height():
    low = read(barometer, barometer.Barometer(), truth())
    high = read(barometer, barometer.Barometer(), truth(position=(0.0, 0.0, 10.0)))
    assert low.pressure == pytest.approx(pressure(STANDARD.atmosphere, STANDARD.home.height))
    assert high.pressure - low.pressure == pytest.approx(-1.19 * 9.81 * 10.0, rel=0.02)


def test_gps_position_is_delayed_by_latency():
    p = gps.Gps(latency_samples=2)
    path = [truth(position=(float(k), 2.0 * k, 0.5 * k), velocity=(10.0 * k, 0.0, 0.0)) for k in range(6)]
    reading = read(gps, p, *path)
    np.testing.assert_allclose(
        (reading.latitude_deg, reading.longitude_deg, reading.height),
        enu_to_geodetic(STANDARD.home, (3.0, 6.0, 1.5)),
        atol=1e-12,
    )
    assert reading.velocity_world == (30.0, 0.0, 0.0)
    assert reading.age == pytest.approx(0.2)


def test_gps_reports_its_position_variance():
    for p in (gps.RTK, gps.STANDARD):
        reading = read(gps, p, truth())
        east, _, up = reading.position_variance
        assert east == pytest.approx(
            p.correlated_error_horizontal**2 + p.noise_horizontal_m_per_sqrt_hz**2 * p.rate / 2
        )
        assert up == pytest.approx(p.correlated_error_vertical**2 + p.noise_vertical_m_per_sqrt_hz**2 * p.rate / 2)
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
        (2.0, 26.0, math.inf),  # beyond the maximum tilt: no echo
        (0.199, 0.0, 0.2),
        (0.19, 0.0, -math.inf),  # REP 117: detected, but too near
        (7.65, 0.0, 7.65),
        (7.66, 0.0, math.inf),
        (1.2345, 0.0, 1.23),
    ],
)
def test_sonar_range_by_height_and_tilt(height, tilt_deg, expected):
    reading = read(sonar, SONAR, truth(attitude=from_roll_pitch_yaw(math.radians(tilt_deg), 0.0, 0.4), height=height))
    assert reading.range == np.float32(expected)
    assert reading.valid


@pytest.mark.parametrize(
    ("echo", "rotor_speed", "farthest"),
    [
        (sonar.Echo(), 400.0, 7.65),
        (sonar.Echo(absorption_db_per_m=0.0, ground_loss_db=20.0), 0.0, 0.765),
        (sonar.Echo(absorption_db_per_m=0.0, propeller_noise_db=20.0), 400.0, 0.765),
        (sonar.Echo(absorption_db_per_m=0.0, propeller_noise_db=20.0), 200.0, 7.65 / math.sqrt(1.0 + 99.0 / 32.0)),
        (sonar.Echo(absorption_db_per_m=0.0, propeller_noise_db=20.0), 0.0, 7.65),
        (sonar.Echo(ground_loss_db=20.0 * math.log10(2.0) + 2.6 * 3.825), 0.0, 3.825),
    ],
)
def test_soft_ground_and_propellers_reduce_range_of_sonar(echo, rotor_speed, farthest):
    p = SONAR._replace(resolution=0.0, echo=echo)
    near, far = (
        read(sonar, p, truth(height=scale * farthest)._replace(rotors=Rotors(rotor_speed))).range
        for scale in (1.0 - 1e-6, 1.0 + 1e-6)
    )
    assert near == pytest.approx(farthest, rel=2e-6)
    assert far == math.inf


def test_share_of_lost_echoes_with_fading():
    """The level of an echo at 3.825 m is 6 dB above the threshold: one deviation."""
    fading = sonar.Echo(absorption_db_per_m=0.0, fading_db=20.0 * math.log10(2.0))
    p, now = SONAR._replace(echo=fading), truth(height=3.825)
    s = sonar.initial(p, KEY, now)
    lost = [sonar.sample(p, s, KEY, tick, now)[1].range == math.inf for tick in range(2000)]
    assert np.mean(lost) == pytest.approx(0.1587, abs=0.025)


@pytest.mark.parametrize(("slope_deg", "tilt_deg"), [(20.0, 0.0), (20.0, 20.0), (20.0, -4.0), (8.0, 0.0), (20.0, -6.0)])
def test_sonar_reads_nearest_ground_of_slope(slope_deg, tilt_deg):
    """The nearest ground within the beam: across the slope 2 m cos(slope), at slope - tilt from the beam's axis."""
    slope, tilt = math.radians(slope_deg), math.radians(tilt_deg)
    ground = relief(slope=(0.0, math.tan(slope)))
    p = SONAR._replace(resolution=0.0)
    reading = read(sonar, p, truth((0.0, 0.0, 2.0), from_roll_pitch_yaw(tilt, 0.0, 0.0), terrain=ground))
    off = abs(slope - tilt)
    expected = 2.0 * math.cos(slope) / math.cos(max(0.0, off - math.radians(10.0)))
    assert reading.range == pytest.approx(math.inf if off > math.radians(25.0) else expected, rel=1e-6)


def test_sonar_sees_box_and_next_tread_of_stair():
    over_box = relief(boxes=[(0.5, 0.0, 0.4, 0.4, 0.0, 0.8)])
    p = sonar.Sonar(half_beam_deg=0.0)
    assert read(sonar, p, truth((0.5, 0.0, 2.0), terrain=over_box)).range == pytest.approx(1.2)
    assert read(sonar, p, truth((0.0, 0.0, 2.0), terrain=over_box)).range == pytest.approx(2.0)
    stair = relief(steps=[(1.0, 0.2), (2.0, 0.3)])
    assert [round(read(sonar, p, truth((x, 5.0, 3.0), terrain=stair)).range, 6) for x in (0.5, 1.5, 9.0)] == [
        3.0,
        2.8,
        2.5,
    ]


def test_accelerometers_off_centre_measure_rotation():
    """On a wheel of 0.3 m radius with 2 rad/s and 5 rad/s^2: w^2 r inwards, a r tangentially."""
    p = imu.Imu(position=(0.3, 0.0, 0.0))
    spinning = truth(omega=(0.0, 0.0, 2.0))._replace(angular_acceleration_body=(0.0, 0.0, 5.0))
    np.testing.assert_allclose(read(imu, p, spinning).specific_force_body, (-1.2, 1.5, G), atol=1e-12)
    assert read(imu, imu.Imu(), spinning).specific_force_body == (0.0, 0.0, G)


def test_gps_measures_at_antenna():
    """0.4 m ahead on a vehicle with heading north and 1 rad/s to the left: 0.4 m north, 0.4 m/s to the west."""
    p = gps.Gps(antenna=(0.4, 0.0, 0.1))
    north = truth((1.0, 2.0, 3.0), from_roll_pitch_yaw(0.0, 0.0, math.pi / 2), (5.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    reading = read(gps, p, north)
    np.testing.assert_allclose(
        (reading.latitude_deg, reading.longitude_deg, reading.height),
        enu_to_geodetic(STANDARD.home, (1.0, 2.4, 3.1)),
        atol=1e-12,
    )
    np.testing.assert_allclose(reading.velocity_world, (4.6, 0.0, 0.0), atol=1e-12)


def test_gps_has_no_fix_under_roof():
    p = gps.Gps(outages=(gps.Outage(10.0, 0.0, 3.0), gps.Outage(0.0, 20.0, 1.0)))
    places = [(0.0, 0.0), (7.1, 0.0), (6.9, 0.0), (10.0, 2.9), (0.0, 20.5), (0.0, 18.9)]
    assert [read(gps, p, truth((*place, 2.0))).valid for place in places] == [True, False, True, False, False, True]


def test_motor_current_adds_magnetic_field():
    """10 A at 30 nT/A along y."""
    near = truth()._replace(rotors=Rotors(current=10.0))
    leads = magnetometer.Magnetometer(current_nt_per_a=(0.0, 30.0, 0.0))
    change = np.subtract(read(magnetometer, leads, near).field_body, FIELD)
    np.testing.assert_allclose(change, (0.0, 300e-9, 0.0), atol=1e-15)


SIDES = {  # velocity through the air, body: published share of the dynamic pressure
    (10.0, 0.0, 0.0): -0.314,
    (-10.0, 0.0, 0.0): -0.284,
    (0.0, -10.0, 0.0): -0.753,
    (0.0, 10.0, 0.0): -0.598,
    (0.0, 0.0, 10.0): 0.0,
}


@pytest.mark.parametrize("air", SIDES)
def test_barometer_static_pressure_error_by_direction(air):
    """Published coefficients of a quadrotor (PX4 pull request 19507); 60 Pa at 10 m/s for any heading."""
    p = parameters("barometer", {"preset": "ideal", "static_pressure_error": {}}, 0.004)
    for attitude in (NO_ROTATION, from_roll_pitch_yaw(0.2, -0.3, 2.0)):
        flying = truth(attitude=attitude)._replace(air_density=1.2, air_velocity_world=rotate(attitude, air))
        still = read(barometer, barometer.Barometer(), flying).pressure
        assert read(barometer, p, flying).pressure - still == pytest.approx(60.0 * SIDES[air], abs=1e-9)


def test_barometer_height_rises_by_static_pressure_error():
    """At 9 m/s sideways -0.753 * 49.6 Pa = -37.4 Pa are 3.1 m by dp/dz = -rho g."""
    p = parameters("barometer", {"preset": "ideal", "static_pressure_error": {}}, 0.004)
    flying = truth()._replace(air_density=1.225, air_velocity_world=(0.0, -9.0, 0.0))
    height = pressure_altitude(STANDARD.atmosphere, read(barometer, p, flying).pressure) - STANDARD.home.height
    assert height == pytest.approx(0.753 * 0.5 * 81.0 / 9.80665, rel=0.03)  # density and gravity of the place


def test_pressure_error_of_single_direction_keeps_other_defaults():
    p = parameters("barometer", {"static_pressure_error": {"vertical": 0.1}}, 0.004)
    assert p.static_pressure_error == barometer.StaticPressureError(vertical=0.1)
    assert parameters("barometer", {}, 0.004).static_pressure_error is None


def test_airspeed_measures_only_flow_along_body_x():
    """10 m/s forwards at 1.2 kg/m^3 cause 60 Pa; backwards -60 Pa; sideways 0."""
    north = truth(attitude=from_roll_pitch_yaw(0.0, 0.0, math.pi / 2))._replace(air_density=1.2)
    for air, expected in (((0.0, 10.0, 0.0), 60.0), ((0.0, -10.0, 0.0), -60.0), ((10.0, 0.0, 3.0), 0.0)):
        reading = read(airspeed, airspeed.Airspeed(), north._replace(air_velocity_world=air))
        assert reading.pressure == pytest.approx(expected, abs=1e-12)
    assert read(airspeed, airspeed.SDP33, north._replace(air_velocity_world=(0.0, 90.0, 0.0))).pressure == 1500.0


def test_airspeed_noise_and_spread():
    """White noise of the stated density at 50 Hz; zero point and span over 300 units."""
    still = truth()._replace(air_density=1.2, air_velocity_world=(10.0, 0.0, 0.0))
    p = airspeed.Airspeed(noise_pa_per_sqrt_hz=0.5)
    s, result = airspeed.initial(p, KEY, still), []
    for tick in range(4000):
        s, reading = airspeed.sample(p, s, KEY, tick, still)
        result.append(reading.pressure)
    assert np.std(result) == pytest.approx(0.5 * math.sqrt(25.0), rel=0.05)
    assert reading.variance == pytest.approx(0.25 * 25.0)
    p, units = airspeed.Airspeed(turn_on_bias_pa=0.2, scale_error=0.03), []
    for seed in range(300):
        key = stream_key(seed, "drone1", "airspeed")
        units.append(airspeed.sample(p, airspeed.initial(p, key, still), key, 0, still)[1].pressure)
    assert np.std(units) == pytest.approx(math.hypot(0.2, 0.03 * 60.0), rel=0.12)


@pytest.mark.parametrize(
    ("azimuth", "elevation", "expected"),
    [(0.0, -90.0, 2.5), (0.0, -30.0, 5.0), (90.0, -45.0, 2.5 * math.sqrt(2)), (0.0, 10.0, math.inf)],
)
def test_rangefinder_in_any_direction_over_level_ground(azimuth, elevation, expected):
    p = rangefinder.Rangefinder(azimuth_deg=azimuth, elevation_deg=elevation, position=(0.0, 0.0, -0.5))
    place = truth((7.0, 8.0, 3.0), from_roll_pitch_yaw(0.0, 0.0, 0.7))
    assert read(rangefinder, p, place).range == pytest.approx(expected)


def test_rangefinder_ahead_sees_wall_and_its_limits():
    """A box 4 m ahead of a level ray; +inf for other directions and beyond the range, -inf below the minimum."""
    wall = relief(boxes=[(6.0, 0.0, 4.0, 4.0, 0.0, 5.0)])
    p = rangefinder.Rangefinder(elevation_deg=0.0)
    assert read(rangefinder, p, truth((0.0, 0.0, 2.0), terrain=wall)).range == pytest.approx(4.0, abs=1e-6)
    away = from_roll_pitch_yaw(0.0, 0.0, math.pi)
    assert read(rangefinder, p, truth((0.0, 0.0, 2.0), away, terrain=wall)).range == math.inf
    for x, expected in ((0.0, math.inf), (3.0, 1.0), (3.8, -math.inf)):
        limited = p._replace(range_min=0.3, range_max=3.0)
        result = read(rangefinder, limited, truth((x, 0.0, 2.0), terrain=wall)).range
        assert result == expected or result == pytest.approx(expected)


def test_rangefinder_noise():
    p = rangefinder.Rangefinder(noise_m_per_sqrt_hz=0.01)
    s, result = rangefinder.initial(p, KEY, truth((0.0, 0.0, 4.0))), []
    for tick in range(4000):
        s, reading = rangefinder.sample(p, s, KEY, tick, truth((0.0, 0.0, 4.0)))
        result.append(reading.range)
    assert np.mean(result) == pytest.approx(4.0, abs=4e-3)
    assert np.std(result) == pytest.approx(0.01 * 5.0, rel=0.05)


def test_optical_flow_of_rotation_is_body_rate():
    p, turning = optical_flow.OpticalFlow(), truth((0.0, 0.0, 3.0), omega=(0.3, -0.2, 0.5))
    reading = read(optical_flow, p, turning)
    assert reading.flow == reading.rate == (0.3, -0.2)


def test_optical_flow_over_moving_ground():
    """By geometry: the body rate that moves the image of the point on the axis at the same speed."""
    attitude, velocity = from_roll_pitch_yaw(0.2, -0.1, 1.3), np.array([2.0, -1.0, 0.5])
    ground = relief(slope=(0.1, -0.2))
    for terrain, tolerance in ((LEVEL, 1e-12), (ground, 1e-6)):
        now = truth((1.0, 2.0, 4.0), attitude, tuple(velocity), terrain=terrain)
        w, x, y, z = attitude
        R = Rotation.from_quat([x, y, z, w]).as_matrix()
        axis = -R[:, 2]
        slope = np.array([0.1, -0.2]) if terrain is ground else np.zeros(2)
        over = 4.0 - slope @ [1.0, 2.0]
        distance = over / (slope @ axis[:2] - axis[2])
        image = -(R.T @ velocity) / distance  # [rad/s] of the point across the axis, body x and y
        reading = read(optical_flow, optical_flow.OpticalFlow(), now)
        assert reading.distance == pytest.approx(distance, rel=max(tolerance, 1e-9))
        # a body that turns about x by r has the point below it move to +y by -r, about y to -x by -r
        assert reading.flow == pytest.approx((-image[1], image[0]), rel=1e-6)


def test_optical_flow_without_texture_and_its_noise():
    p = optical_flow.PMW3901
    assert not read(optical_flow, p, truth((0.0, 0.0, 0.5), velocity=(4.0, 0.0, 0.0))).valid  # 8 rad/s
    assert not read(optical_flow, p, truth((0.0, 0.0, 35.0))).valid
    assert not read(optical_flow, p, truth((0.0, 0.0, 5.0), from_roll_pitch_yaw(2.0, 0.0, 0.0))).valid
    noisy = optical_flow.OpticalFlow(noise_rad_per_s_per_sqrt_hz=0.01)
    s, result = optical_flow.initial(noisy, KEY, truth((0.0, 0.0, 5.0))), []
    for tick in range(4000):
        s, reading = optical_flow.sample(noisy, s, KEY, tick, truth((0.0, 0.0, 5.0)))
        result.append(reading.flow)
    assert np.std(result, axis=0) == pytest.approx([0.05, 0.05], rel=0.05)
    assert reading.variance == pytest.approx(0.0025)


def coning(k, rate):
    """Return attitude and rate at sample k of a body whose z axis moves on a cone of 5 degrees at 40 Hz."""
    tilt, turn = math.radians(5.0), 2.0 * math.pi * 40.0
    t = k / rate
    half = math.sin(tilt / 2)
    return Quaternion(math.cos(tilt / 2), half * math.cos(turn * t), half * math.sin(turn * t), 0.0), (
        -turn * math.sin(tilt) * math.sin(turn * t),
        turn * math.sin(tilt) * math.cos(turn * t),
        turn * (1.0 - math.cos(tilt)),
    )


def test_delta_angles_of_coning_restore_attitude():
    """Composed delta angles equal the attitude; instantaneous rates drift away from it."""
    rate, ends = 250.0, {}
    for delta_output in (True, False):
        p = imu.Imu(rate=rate, delta_output=delta_output)
        path = [truth(attitude=q, omega=omega) for q, omega in (coning(k, rate) for k in range(251))]
        s, attitude = imu.initial(p, KEY, path[0]), path[0].attitude
        for tick, now in enumerate(path):
            s, reading = imu.sample(p, s, KEY, tick, now)
            if tick:
                attitude = multiply(attitude, exp(tuple(x / rate for x in reading.omega_body)))
        ends[delta_output] = np.linalg.norm(log(multiply(conjugate(path[-1].attitude), attitude)))
    assert ends[True] < 1e-12
    assert ends[False] > 0.02


def test_integrated_readings_restore_velocity_at_imu():
    """The sum of R_before f / rate - g t is the change of v + R (omega x r), of a turning, accelerating body."""
    rate, place = 100.0, (0.2, -0.1, 0.05)
    p, gained, before, path = imu.Imu(rate=rate, delta_output=True, position=place), np.zeros(3), None, []
    for k in range(60):
        t = k / rate
        attitude = multiply(from_roll_pitch_yaw(0.3, -0.2, 0.0), exp((0.0, 0.0, 4.0 * t)))
        path.append(truth(attitude=attitude, velocity=(3.0 * t, t * t, math.sin(t)), omega=(0.0, 0.0, 4.0)))
    s = imu.initial(p, KEY, path[0])
    for tick, now in enumerate(path):
        s, reading = imu.sample(p, s, KEY, tick, now)
        if tick:
            gained += np.array(rotate(before, reading.specific_force_body)) / rate
            gained[2] -= G / rate
        before = now.attitude
    speeds = [np.add(x.velocity_world, rotate(x.attitude, np.cross((0, 0, 4.0), place))) for x in (path[0], path[-1])]
    np.testing.assert_allclose(gained, speeds[1] - speeds[0], atol=1e-12)


def test_rotor_vibration_is_aliased_and_integration_attenuates():
    """251 Hz sampled at 250 Hz appears as 1 Hz; the mean over a sample attenuates it by sin(x)/x, x = pi 251/250."""
    speed = 2.0 * math.pi * 251.0
    shaking = imu.Vibration((100.0, 100.0, 50.0), 0.5 * speed)
    now, result = truth()._replace(rotors=Rotors(speed)), {}
    for delta_output in (False, True):
        p = imu.Imu(rate=250.0, vibration=shaking, delta_output=delta_output)
        s, forces = imu.initial(p, KEY, now), []
        for tick in range(1000):
            s, reading = imu.sample(p, s, KEY, tick, now)
            forces.append(reading.specific_force_body)
        result[delta_output] = np.array(forces) - (0.0, 0.0, G)
    spectrum = np.abs(np.fft.rfft(result[False], axis=0)) / 500.0
    assert np.argmax(spectrum[:, 0]) == 4  # cycles in 4 s
    amplitude = 4.0 * 0.1 * 9.80665  # with the square of the speed
    np.testing.assert_allclose(spectrum[4], (amplitude, amplitude, 0.5 * amplitude), rtol=1e-6)
    left = np.abs(np.fft.rfft(result[True], axis=0))[4, 0] / 500.0
    x = math.pi * 251.0 / 250.0
    assert left == pytest.approx(amplitude * abs(math.sin(x) / x), rel=1e-6)


def test_rotor_thrust_changes_barometer_pressure():
    flying = truth()._replace(rotors=Rotors(thrust=98.0))
    still = read(barometer, barometer.Barometer(), flying).pressure
    assert read(barometer, barometer.Barometer(wash_pa_per_n=-0.2), flying).pressure - still == pytest.approx(-19.6)


def test_gps_dilution_of_precision_by_published_geometries():
    """A regular tetrahedron has PDOP 1.5; three on the horizon and one overhead by hand HDOP^2 = VDOP^2 = 4/3."""
    low = math.degrees(math.asin(1.0 / 3.0))
    tetrahedron = [gps.Satellite(azimuth, -low) for azimuth in (0.0, 120.0, 240.0)] + [gps.Satellite(0.0, 90.0)]
    factor = np.array(gps.geometry.py_func(tuple(tetrahedron))).reshape(3, 3)
    assert np.trace(factor @ factor.T) == pytest.approx(1.5**2)
    flat = [gps.Satellite(azimuth, 0.0) for azimuth in (0.0, 120.0, 240.0)] + [gps.Satellite(0.0, 90.0)]
    factor = np.array(gps.geometry.py_func(tuple(flat))).reshape(3, 3)
    assert np.diag(factor @ factor.T) == pytest.approx([2 / 3, 2 / 3, 4 / 3])


STREET = tuple(gps.Satellite(a, e) for a, e in ((10.0, 60.0), (170.0, 50.0), (20.0, 30.0), (200.0, 70.0), (95.0, 80.0)))


def test_gps_errors_have_covariance_of_satellites_in_view():
    """Against least squares with rows (east, north, up, 1) over 1500 receivers, and against the published variance."""
    p = gps.Gps(sky=STREET, range_correlated_error=2.0, range_noise_m_per_sqrt_hz=0.5)
    rows = [
        (math.cos(e) * math.sin(a), math.cos(e) * math.cos(a), math.sin(e), 1.0)
        for a, e in np.radians([tuple(satellite) for satellite in STREET])
    ]
    expected = np.linalg.inv(np.array(rows).T @ rows)[:3, :3] * (4.0 + 0.25 * 5.0)
    result = []
    for seed in range(1500):
        key = stream_key(seed, "drone1", "gps")
        _, reading = gps.sample(p, gps.initial(p, key, truth()), key, 0, truth())
        result.append((reading.longitude_deg, reading.latitude_deg, reading.height))
    assert reading.position_variance == pytest.approx(np.diag(expected))
    here = np.array(result) - (STANDARD.home.longitude_deg, STANDARD.home.latitude_deg, STANDARD.home.height)
    one = [np.array(enu_to_geodetic(STANDARD.home, v)) for v in ((1.0, 0, 0), (0, 1.0, 0), ZERO)]
    metres = here / (one[0][1] - one[2][1], one[1][0] - one[2][0], 1.0)
    np.testing.assert_allclose(np.cov(metres.T), expected, atol=0.12 * np.trace(expected))
    assert np.sqrt(expected[0, 0]) > 2.0 * np.sqrt(expected[1, 1])  # a street from north to south


def test_noise_is_determined_by_key_and_tick():
    s = imu.initial(imu.MPU6000, KEY, truth())
    assert imu.sample(imu.MPU6000, s, KEY, 5, truth()) == imu.sample(imu.MPU6000, s, KEY, 5, truth())
    assert imu.sample(imu.MPU6000, s, KEY, 5, truth()) != imu.sample(imu.MPU6000, s, KEY, 6, truth())
