"""Messages on request of PX4's ground stations: modes, setpoints, motors, odometry, identity."""

import math

import pytest
from adapter_harness import Bench
from pymavlink.dialects.v20 import all as mavlink

from lapwing.messages import Actuators, MagneticField, Setpoint, Vector3, VehicleState, header
from lapwing.messages.topics import ACTUATORS, IMU, MAG, SETPOINT, TRUTH
from lapwing.messages.types import Imu
from lapwing.services.common.mavlink.dialect import id_of, message_class

NAN = math.nan
ACCEPTED = mavlink.MAV_RESULT_ACCEPTED


def request(bench, station, name, parameter=0.0):
    assert station.command(mavlink.MAV_CMD_REQUEST_MESSAGE, id_of(name), parameter) == ACCEPTED, name
    return station.last(name)


@pytest.mark.parametrize(
    ("name", "seed"),  # CRC_EXTRA in the headers of MAVLink's generator
    [("ESC_INFO", 251), ("ESC_STATUS", 10), ("PROTOCOL_VERSION", 217), ("COMPONENT_METADATA", 182)],
)
def test_additional_messages_have_checksums_of_mavlink(name, seed):
    assert message_class(name).crc_extra == seed


def test_all_modes_are_listed_and_each_can_be_chosen():
    bench = Bench()
    bench.vehicle.armed = True
    station = bench.station()
    request(bench, station, "AVAILABLE_MODES")
    modes = station.all("AVAILABLE_MODES")
    assert [m.mode_index for m in modes] == list(range(1, modes[0].number_modes + 1))
    assert {m.mode_name for m in modes if m.standard_mode == 0} == {"Hold", "Offboard", "Stabilized", "Acro"}
    assert {m.standard_mode for m in modes} == {0, 1, 4, 5, 6, 7, 8}
    assert not any(m.properties & mavlink.MAV_MODE_PROPERTY_NOT_USER_SELECTABLE for m in modes)
    for m in modes:
        assert bench.adapter.vehicle.firmware.mode_kind(m.custom_mode)
    assert request(bench, station, "AVAILABLE_MODES", 3.0).mode_index == 3
    assert len(station.all("AVAILABLE_MODES")) == 1
    assert station.command(512, id_of("AVAILABLE_MODES"), 99.0) == mavlink.MAV_RESULT_TEMPORARILY_REJECTED


def test_current_mode_is_available():
    bench = Bench()
    bench.vehicle.mode = "return"
    bench.step(2)
    station = bench.station()
    m = request(bench, station, "CURRENT_MODE")
    assert (m.standard_mode, m.custom_mode) == (mavlink.MAV_STANDARD_MODE_SAFE_RECOVERY, 4 << 16 | 5 << 24)
    assert m.intended_custom_mode == m.custom_mode


def test_standard_mode_is_entered_by_its_number():
    bench = Bench()
    bench.vehicle.armed = True
    station = bench.station()
    assert station.command(mavlink.MAV_CMD_DO_SET_STANDARD_MODE, mavlink.MAV_STANDARD_MODE_LAND) == ACCEPTED
    assert bench.vehicle.kinds["land"]
    assert station.command(mavlink.MAV_CMD_DO_SET_STANDARD_MODE, 0.0) == mavlink.MAV_RESULT_UNSUPPORTED


def followed(armed=True, **changed):
    bench = Bench()
    bench.vehicle.armed = armed
    fields = {"position": Vector3(30.0, 40.0, 10.35), "velocity": Vector3(1.0, 2.0, 3.0), "yaw": 0.0, "yaw_rate": 0.1}
    setpoint = Setpoint(header(0, "world"), **fields | changed)
    actuators = Actuators(
        header(0, "body"), (4.0,) * 4, True, (20.0,) * 4, attitude_reference=Vector3(0.1, 0.2, 0.5 * math.pi)
    )
    bench.vehicle.more = [(SETPOINT, setpoint), (ACTUATORS, actuators)]
    station = bench.station()
    bench.step(60)
    return bench, station


def test_setpoint_is_shown_in_ned_and_on_earth():
    _, station = followed()
    m = station.last("POSITION_TARGET_LOCAL_NED")
    assert (m.x, m.y, m.z) == pytest.approx((40.0, 30.0, -10.0))  # from the start position
    assert (m.vx, m.vy, m.vz) == (2.0, 1.0, -3.0)
    assert (m.yaw, m.yaw_rate) == pytest.approx((0.5 * math.pi, -0.1))
    assert m.type_mask == 0
    m = station.last("POSITION_TARGET_GLOBAL_INT")
    assert m.alt == pytest.approx(10.0, abs=1e-3)  # above home
    assert (m.lat_int - 407686000) * 1e-7 * 111_049 == pytest.approx(40.0, rel=2e-3)


def test_unused_setpoint_fields_are_masked():
    _, station = followed(position=Vector3(NAN, NAN, 5.0), yaw=NAN)
    m = station.last("POSITION_TARGET_LOCAL_NED")
    assert m.type_mask == 0b0000_0100_0000_0011
    assert station.last("POSITION_TARGET_GLOBAL_INT") is None


def test_setpoint_is_empty_while_disarmed():
    _, station = followed(armed=False)
    for kind in ("POSITION_TARGET_LOCAL_NED", "POSITION_TARGET_GLOBAL_INT", "ATTITUDE_TARGET"):
        assert station.last(kind) is None


def test_attitude_setpoint_has_commanded_heading():
    bench, station = followed()
    m = station.last("ATTITUDE_TARGET")
    w, x, y, z = m.q
    roll = math.atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    pitch = math.asin(2.0 * (w * y - z * x))
    yaw = math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    assert (roll, pitch, yaw) == pytest.approx((0.1, -0.2, 0.0), abs=1e-6)  # facing north, FRD
    assert m.type_mask == 7  # no body rates
    assert m.thrust == pytest.approx((4.0 / bench.adapter.vehicle.description.max_voltage) ** 2)


def test_motors_and_their_outputs():
    bench, station = followed()
    truth = VehicleState(
        rotor_speed=(100.0, 200.0, 300.0, 0.0), motor_voltage=(10.0,) * 4, motor_current=(1.0, 2.0, 3.0, 4.0)
    )
    bench.vehicle.more += [(TRUTH, truth)]
    bench.step(60)
    m = station.last("ESC_STATUS")
    assert m.rpm == [955, 1910, 2865, 0]
    assert (m.voltage[0], m.current[2], m.index) == (10.0, 3.0, 0)
    m = station.last("ESC_INFO")
    assert (m.count, m.info, m.failure_flags) == (4, 0b1111, [0] * 4)
    m = request(bench, station, "ACTUATOR_OUTPUT_STATUS")
    assert m.active == 0b1111
    assert m.actuator[0] == pytest.approx(1000.0 + 4000.0 / bench.adapter.vehicle.description.max_voltage)
    assert m.actuator[4] == 0.0


def test_stopped_motors_get_px4_pulse_width():
    bench, station = followed()
    running = bench.vehicle.more
    for armed, failed, voltages, pulses in (
        (False, 0, (0.0,) * 4, [900.0] * 4),
        (True, 0, (0.0,) * 4, [1000.0] * 4),
        (True, 2, (0.0,) * 4, [1000.0, 900.0, 1000.0, 1000.0]),
    ):
        bench.vehicle.armed, bench.vehicle.status = armed, {"failed_motor": failed}
        bench.vehicle.more = [*running, (ACTUATORS, Actuators(motor_voltage=voltages))]
        bench.step(2)
        assert request(bench, station, "ACTUATOR_OUTPUT_STATUS").actuator[:4] == pulses


def test_odometry_has_variances_of_estimator_in_ned():
    bench = Bench()
    bench.vehicle.position = [1.0, 2.0, 3.0]
    plain = bench.vehicle.messages

    def messages():
        for topic, message in plain():
            yield (
                topic,
                message._replace(position_std=Vector3(0.1, 0.2, 0.3)) if topic.name.endswith("estimate") else message,
            )

    bench.vehicle.messages = messages
    bench.step(2)
    m = request(bench, bench.station(), "ODOMETRY")
    assert (m.x, m.y, m.z) == pytest.approx((2.0, 1.0, 0.35 - 3.0))  # from the start position
    assert (m.frame_id, m.child_frame_id) == (mavlink.MAV_FRAME_LOCAL_NED, mavlink.MAV_FRAME_LOCAL_NED)
    assert [m.pose_covariance[k] for k in (0, 6, 11)] == pytest.approx([0.04, 0.01, 0.09])
    assert math.isnan(m.pose_covariance[1])
    assert m.quality == 100


def test_flight_times():
    bench = Bench()
    station = bench.station()
    bench.step(50)
    assert request(bench, station, "FLIGHT_INFORMATION").flight_uuid == 0
    bench.vehicle.armed = True
    bench.step(50)
    armed = request(bench, station, "FLIGHT_INFORMATION")
    assert armed.arming_time_utc == pytest.approx(1e6 * (bench.vehicle.seconds - 1.0), abs=3e5)
    assert (armed.takeoff_time_utc, armed.flight_uuid) == (0, 1)
    bench.vehicle.landed = False
    bench.step(50)
    bench.vehicle.landed = True
    bench.step(5)
    m = request(bench, station, "FLIGHT_INFORMATION")
    assert m.arming_time_utc == armed.arming_time_utc
    assert armed.arming_time_utc < m.takeoff_time_utc < 1e3 * m.landing_time


def test_identity_and_missing_parts():
    bench = Bench()
    bench.step(2)
    station = bench.station()
    assert request(bench, station, "PROTOCOL_VERSION").max_version == 200
    station.got.clear()
    assert station.command(mavlink.MAV_CMD_REQUEST_PROTOCOL_VERSION, 1.0) == ACCEPTED
    assert station.last("PROTOCOL_VERSION")
    m = request(bench, station, "RC_CHANNELS")
    assert (m.chancount, m.chan1_raw, m.rssi) == (0, 0xFFFF, 255)


@pytest.mark.parametrize(("firmware", "bit"), [("px4", "BYTEWISE"), ("ardupilot", "C_CAST")])
def test_encoding_of_integer_parameters_is_announced(firmware, bit):
    bench = Bench(f"mavlink.firmware={firmware}")
    bench.step(2)
    m = request(bench, bench.station(), "AUTOPILOT_VERSION")
    encodings = {
        name: getattr(mavlink, f"MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_{name}") for name in ("BYTEWISE", "C_CAST")
    }
    assert [name for name, mask in encodings.items() if m.capabilities & mask] == [bit]


def test_scaled_imu_has_integer_readings():
    bench = Bench()
    imu = Imu(linear_acceleration=Vector3(0.0, 0.0, 9.80665), angular_velocity=Vector3(0.1, 0.2, 0.3))
    bench.vehicle.more = [(IMU, imu), (MAG, MagneticField(magnetic_field=Vector3(1e-6, 25e-6, -38e-6)))]
    bench.step(2)
    m = request(bench, bench.station(), "SCALED_IMU")
    assert (m.xacc, m.yacc, m.zacc) == (0, 0, -1000)
    assert (m.xgyro, m.ygyro, m.zgyro) == (100, -200, -300)
    assert (m.xmag, m.ymag, m.zmag) == (10, -250, 380)


def test_wind_is_air_velocity_at_vehicle():
    bench = Bench()
    truth = VehicleState(wind=Vector3(3.0, 1.0, 0.5))
    truth = truth._replace(pose=truth.pose._replace(position=truth.pose.position._replace(z=12.0)))
    bench.vehicle.more = [(TRUTH, truth)]
    bench.step(2)
    m = request(bench, bench.station(), "WIND_COV")
    assert (m.wind_x, m.wind_y, m.wind_z) == (1.0, 3.0, -0.5)
    assert m.wind_alt == pytest.approx(292.0)
