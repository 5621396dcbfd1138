"""Units, frames and masks of PX4's simulator messages, read back by pymavlink."""

import math

import numpy as np
import pytest
from pymavlink.dialects.v20 import all as mavlink

from lapwing.dynamics.environment import STANDARD
from lapwing.kernels import kernel
from lapwing.services.common.ports import (
    GPS_FLOAT,
    GPS_RTK,
    GPS_SBAS,
    GPS_SINGLE,
    DistanceReading,
    ExternalVisionReading,
    GpsReading,
    ImuReading,
    MagnetometerReading,
    OpticalFlowReading,
    TrueState,
)
from lapwing.services.px4.messages import distance_message, gps_message, rare_messages, truth_message
from lapwing.services.px4.schema import RC
from lapwing.services.px4.sensor_frame import Sensors, frame, pressure_altitude, read_controls, sensor_frame


def sensor(time_us=4000, **readings):
    return mavlink.MAVLink(None).parse_buffer(sensor_frame(0, time_us, Sensors(**readings)))[0]


def packed(message, sequence=0, component=1):
    codec = mavlink.MAVLink(None, srcSystem=1, srcComponent=component)
    codec.seq = sequence
    return message.pack(codec)


def gps(reading, time_us=4000):
    return mavlink.MAVLink(None).parse_buffer(packed(gps_message(time_us, reading)))[0]


def test_true_state_is_that_of_the_plant():
    """Nose to the east (FLU in ENU is the identity): yaw 90 degrees; 100 m north are 9e-4 degrees of latitude."""
    state = TrueState((0.0, 100.0, 5.0), velocity_world=(1.0, 2.0, 3.0), omega_body=(0.1, 0.2, 0.3),
                      acceleration_world=(9.80665, 0.0, 0.0))  # fmt: skip
    home = STANDARD.home
    (result,) = mavlink.MAVLink(None).parse_buffer(packed(truth_message(home, 4000, state)))
    assert result.attitude_quaternion == pytest.approx([math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5)], abs=1e-6)
    assert 1e-7 * result.lat - home.latitude_deg == pytest.approx(100.0 / 111.1e3, rel=2e-3)
    assert 1e-7 * result.lon == pytest.approx(home.longitude_deg, abs=1e-7)
    assert 1e-3 * result.alt == pytest.approx(home.height + 5.0, abs=2e-3)
    assert (result.vx, result.vy, result.vz) == (200, 100, -300)
    assert (result.xacc, result.yacc, result.zacc) == (1000, 0, 0)
    assert [result.rollspeed, result.pitchspeed, result.yawspeed] == pytest.approx([0.1, -0.2, -0.3])


def received(port, reading, flow_interval=0.02, rc=()):
    """Return the message of a port at 4 ms as PX4 reads it, None if there is none."""
    message = rare_messages(STANDARD.home, flow_interval, rc)[port](4000, reading)
    return message and mavlink.MAVLink(None).parse_buffer(packed(message))[0]


def test_optical_flow_has_the_signs_of_mavlink():
    """Motion along FRD y gives a negative flow about x, along x a positive one about y; a turn its rate."""
    forward, right, height = 2.0, 0.5, 4.0
    moving = OpticalFlowReading((-right / height, -forward / height), distance=height, valid=True)
    result = received("optical_flow", moving)
    assert result.integration_time_us == 20_000
    assert (result.integrated_x, result.integrated_y) == pytest.approx((-0.02 * 0.125, 0.02 * 0.5))
    assert (result.integrated_xgyro, result.integrated_ygyro) == (0.0, 0.0)
    assert (result.distance, result.quality) == (4.0, 255)
    turning = received("optical_flow", OpticalFlowReading((0.3, 0.2), (0.3, 0.2), 4.0, valid=True))
    assert (turning.integrated_x, turning.integrated_y) == pytest.approx((0.006, -0.004))
    assert (turning.integrated_xgyro, turning.integrated_ygyro) == pytest.approx((0.006, -0.004))
    assert received("optical_flow", OpticalFlowReading()).quality == 0


def test_redundant_units_have_their_instances_and_axes():
    imu = received("imu3", ImuReading((0.1, 0.2, 0.3), (1.0, 2.0, 9.8), valid=True))
    assert (imu.id, imu.fields_updated) == (2, 0x3F)
    assert (imu.xacc, imu.yacc, imu.zacc) == pytest.approx((1.0, -2.0, -9.8))
    assert (imu.xgyro, imu.ygyro, imu.zgyro) == pytest.approx((0.1, -0.2, -0.3))
    field = received("magnetometer2", MagnetometerReading((2e-5, 1e-5, -4e-5), valid=True))
    assert (field.id, field.fields_updated) == (1, 0x1C0)
    assert (field.xmag, field.ymag, field.zmag) == pytest.approx((0.2, -0.1, 0.4))
    fix = GpsReading(40.0, 14.0, 100.0, (1.0,) * 3, (1.0, 2.0, 3.0), valid=True)
    assert (received("gps", fix).id, received("gps2", fix).id) == (0, 1)
    assert received("imu2", ImuReading()) is received("magnetometer2", MagnetometerReading()) is None


def test_external_vision_is_a_pose_in_ned():
    """Nose to the north: yaw 0 in NED, 90 degrees from east in ENU."""
    north = (math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5))
    result = received("external_vision", ExternalVisionReading((1.0, 2.0, 3.0), north, 1e-4, 1e-3, True))
    assert (result.x, result.y, result.z) == (2.0, 1.0, -3.0)
    assert result.q == pytest.approx([1.0, 0.0, 0.0, 0.0], abs=1e-7)
    assert (result.frame_id, result.estimator_type) == (mavlink.MAV_FRAME_LOCAL_NED, mavlink.MAV_ESTIMATOR_TYPE_VISION)
    assert [result.pose_covariance[k] for k in (0, 6, 11, 15, 18, 20)] == pytest.approx([1e-4] * 3 + [1e-3] * 3)
    assert math.isnan(result.vx)
    assert received("external_vision", ExternalVisionReading()) is None


def test_radio_holds_each_row_until_the_next():
    rows = [[1.0, 1500, 1200], [2.0, 1500, 1800]]
    assert received(RC, 0.5, rc=rows) is None
    first, second = received(RC, 1.5, rc=rows), received(RC, 2.0, rc=rows)
    assert (first.chancount, first.chan1_raw, first.chan2_raw, second.chan2_raw) == (2, 1500, 1200, 1800)
    assert first.chan3_raw == 0xFFFF


def test_level_at_rest_accelerates_up_in_frd():
    result = sensor(specific_force_body=(0.0, 0.0, 9.81), omega_body=(0.0, 0.0, 0.0))
    assert (result.xacc, result.yacc) == (0.0, 0.0)
    assert result.zacc == pytest.approx(-9.81)
    assert result.time_usec == 4000
    assert result.id == 0


def test_rates_turn_right_and_nose_up_in_frd():
    result = sensor(omega_body=(0.1, 0.2, 0.3))  # FLU: y to the left, z up
    assert [result.xgyro, result.ygyro, result.zgyro] == pytest.approx([0.1, -0.2, -0.3])


def test_field_of_nose_to_north_points_forward_and_down():
    """Naples: about 0.24 gauss to the north, 0.39 gauss down; with the nose to the north FLU is (north, west, up)."""
    east, north, up = STANDARD.magnetic_field_world
    result = sensor(field_body=(north, -east, up))
    assert result.xmag == pytest.approx(1e4 * north)
    assert 0.2 < result.xmag < 0.3
    assert result.ymag == pytest.approx(1e4 * east)
    assert result.zmag == pytest.approx(-1e4 * up)
    assert 0.3 < result.zmag < 0.5


def test_pressure_is_in_hectopascal():
    result = sensor(pressure=98000.0, dynamic_pressure=50.0)
    assert result.abs_pressure == pytest.approx(980.0)
    assert result.diff_pressure == pytest.approx(0.5)
    assert result.pressure_alt == pytest.approx(pressure_altitude(98000.0))


def hil_sensor(time_us, **readings):
    """Return HIL_SENSOR: FRD, gauss and hPa; id 0 sets PX4's clock."""
    vectors = {"specific_force_body": (1.0, 0x7), "omega_body": (1.0, 0x38), "field_body": (1e4, 0x1C0)}
    values, mask = [], 0
    for name, (factor, bits) in vectors.items():
        x, y, z = readings.get(name, (0.0, -0.0, -0.0))
        values += [factor * x, -factor * y, -factor * z]
        mask |= bits * (name in readings)
    mask |= 0x1A00 * ("pressure" in readings) | 0x400 * ("dynamic_pressure" in readings)
    altitude = pressure_altitude(readings["pressure"]) if "pressure" in readings else 0.0
    pressures = [0.01 * readings.get(name, 0.0) for name in ("pressure", "dynamic_pressure")]
    return mavlink.MAVLink_hil_sensor_message(time_us, *values, *pressures, altitude, 25.0, mask, 0)


@pytest.mark.parametrize("seed", range(20))
def test_compiled_frame_equals_pymavlink(seed):
    random = np.random.default_rng(seed)
    readings = {
        "omega_body": tuple(random.normal(size=3)),
        "specific_force_body": tuple(random.normal(size=3) * 9.81),
        "field_body": tuple(random.normal(size=3) * 1e-5),
        "pressure": random.uniform(5e4, 1.1e5),
        "dynamic_pressure": random.uniform(0.0, 500.0),
    }
    readings = {name: value for name, value in readings.items() if random.random() < 0.6}
    time_us, sequence = int(random.integers(2**50)), int(random.integers(256))
    result = sensor_frame(sequence, time_us, Sensors(**readings))
    assert result == packed(hil_sensor(time_us, **readings), sequence, 51)


def outputs(time_us, values, mode, flags=1):
    return mavlink.MAVLink_hil_actuator_controls_message(time_us, values, mode, flags)


@kernel
def controls(data, size, m):
    return read_controls(data, size, m)


def test_compiled_reader_accepts_exactly_one_frame():
    data, m = packed(outputs(2**40, np.linspace(0.0, 0.75, 16).tolist(), 129), 7), frame()

    def read(content):
        return controls(np.frombuffer(content + bytes(300), np.uint8).copy(), len(content), m)

    assert read(data)
    assert (m.words[0], m.words[1], m.floats[4], m.floats[19], m.bytes[90]) == (2**40, 1, 0.0, 0.75, 129)
    for k in range(len(data)):
        assert not read(data[:k] + bytes((data[k] ^ 1,)) + data[k + 1 :]), k
        assert not read(data[:k])
    assert not read(data + data)
    assert not read(b"")
    short = packed(outputs(5, [0.0] * 16, 0, flags=0))  # zeros at the end are not sent
    assert read(short)
    assert (m.words[0], m.floats[19], m.bytes[90]) == (5, 0.0, 0)


@pytest.mark.parametrize(("pressure", "altitude"), [(101325.0, 0.0), (89874.6, 1000.0), (54019.9, 5000.0)])
def test_pressure_altitude_of_standard_atmosphere(pressure, altitude):
    """U.S. Standard Atmosphere 1976, geopotential altitudes."""
    assert pressure_altitude(pressure) == pytest.approx(altitude, abs=1.0)


@pytest.mark.parametrize(
    ("readings", "mask"),
    [
        ({}, 0),
        ({"specific_force_body": (1.0, 2.0, 3.0)}, 0x7),
        ({"omega_body": (1.0, 2.0, 3.0)}, 0x38),
        ({"field_body": (1e-5, 2e-5, 3e-5)}, 0x1C0),
        ({"pressure": 1e5}, 0x1A00),
        ({"dynamic_pressure": 10.0}, 0x400),
    ],
)
def test_mask_marks_updated_fields(readings, mask):
    bits = {0x7: "ACC", 0x38: "GYRO", 0x1C0: "MAG"}
    assert sensor(**readings).fields_updated == mask
    if mask in bits:
        expected = sum(getattr(mavlink, f"HIL_SENSOR_UPDATED_{axis}{bits[mask]}") for axis in "XYZ")
        assert mask == expected


def test_gps_units():
    reading = GpsReading(40.7686, 14.7907, 281.5, (0.3, 0.4, 1.0), (3.0, 4.0, -1.0), 0.01, 0.1, True)
    result = gps(reading)
    assert (result.lat, result.lon, result.alt) == (407686000, 147907000, 281500)
    assert (result.vn, result.ve, result.vd, result.vel) == (400, 300, 100, 500)
    assert result.cog == round(math.degrees(math.atan2(3.0, 4.0)) * 100)
    assert result.eph == round(100 * math.sqrt(0.7))
    assert result.epv == 100
    assert result.fix_type == 3
    assert result.satellites_visible >= 6


@pytest.mark.parametrize(
    ("velocity", "course"),
    [((0.0, 1.0, 0.0), 0), ((1.0, 0.0, 0.0), 9000), ((0, -1.0, 0), 18000), ((-1.0, 0, 0), 27000)],
)
def test_gps_course_is_clockwise_from_north(velocity, course):
    assert gps(GpsReading(valid=True, velocity_world=velocity)).cog == course


@pytest.mark.parametrize(("kind", "fix_type"), [(GPS_SINGLE, 3), (GPS_SBAS, 4), (GPS_FLOAT, 5), (GPS_RTK, 6)])
def test_gps_kind_of_fix_and_satellites(kind, fix_type):
    result = gps(GpsReading(valid=True, fix=kind, used=7, visible=9))
    assert (result.fix_type, result.satellites_visible) == (fix_type, 9)


def test_gps_outage_has_no_fix():
    result = gps(GpsReading(40.0, 14.0, 10.0, valid=False))
    assert (result.fix_type, result.satellites_visible, result.eph) == (0, 0, 65535)


def test_distance_is_sent_unless_invalid():
    assert distance_message(5000, DistanceReading(valid=False)) is None
    result = mavlink.MAVLink(None).parse_buffer(packed(distance_message(5000, DistanceReading(1.25, valid=True))))[0]
    assert (result.time_boot_ms, result.current_distance, result.orientation) == (5, 125, 25)
