"""PX4's parameters set over a real MAVLink connection to a running process, and their effects."""

import struct
import subprocess
import sys

import pytest
from fake_vehicle import free_port
from pymavlink import mavutil

from lapwing.services.common.mavlink.dialect import mavlink

pytestmark = pytest.mark.long

WAIT = 300.0  # [s] for a message on a busy machine


class Station:
    """Ground station of a run."""

    def __init__(self, port):
        self.link = mavutil.mavlink_connection(f"udpin:127.0.0.1:{port}")
        self.receive("HEARTBEAT")
        self.link.mav.heartbeat_send(6, 8, 0, 0, 0)
        self.receive("GLOBAL_POSITION_INT")

    def receive(self, kind, condition=lambda m: True):
        """Return the next message of a kind that meets a condition."""
        while message := self.link.recv_match(type=kind, blocking=True, timeout=WAIT):
            if condition(message):
                return message
        raise AssertionError(f"no {kind}")

    def set(self, name, value):
        """Set a parameter of integers, and return the value that the vehicle confirms."""
        bits = struct.unpack("<f", struct.pack("<i", value))[0]
        self.link.mav.param_set_send(1, 1, name.encode(), bits, mavlink.MAV_PARAM_TYPE_INT32)
        message = self.receive("PARAM_VALUE", lambda m: m.param_id == name)
        return struct.unpack("<i", struct.pack("<f", message.param_value))[0]

    def command(self, number, *params):
        """Send a command, and return its final result."""
        nan = float("nan")
        self.link.mav.command_long_send(1, 1, number, 0, *params, *[nan] * (7 - len(params)))
        return self.receive("COMMAND_ACK", lambda m: m.command == number and m.result != 5).result


@pytest.fixture
def station(tmp_path):
    port = free_port()
    command = [sys.executable, "-m", "lapwing", "run", "groundstation", "--mavlink", f"udpout:127.0.0.1:{port}"]
    command += ["--speed", "5", "--key-prefix", "test-px4-parameters", "--log", str(tmp_path / "flight.mcap")]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
        result = Station(port)
        yield result
        process.terminate()
        process.wait(WAIT)
    result.link.close()


def test_satellites_of_simulated_gps_decide_fix_and_arming(station):
    station.receive("GPS_RAW_INT", lambda m: m.fix_type >= mavlink.GPS_FIX_TYPE_3D_FIX)
    assert station.set("SIM_GPS_USED", 3) == 3
    assert station.receive("GPS_RAW_INT", lambda m: m.fix_type == mavlink.GPS_FIX_TYPE_NO_FIX).satellites_visible == 3
    gps = mavlink.MAV_SYS_STATUS_SENSOR_GPS
    station.receive("SYS_STATUS", lambda m: not m.onboard_control_sensors_health & gps)
    assert station.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1.0, 0.0) != mavlink.MAV_RESULT_ACCEPTED
    assert station.set("SIM_GPS_USED", 10) == 10
    assert station.receive("GPS_RAW_INT", lambda m: m.fix_type >= 3).satellites_visible == 10
    station.receive("SYS_STATUS", lambda m: m.onboard_control_sensors_health & gps)


def test_detection_of_motor_failures_is_switched_in_flight(station):
    critical, armed = mavlink.MAV_STATE_CRITICAL, mavlink.MAV_MODE_FLAG_SAFETY_ARMED
    assert station.set("FD_ACT_EN", 0) == 0
    assert station.set("CA_FAILURE_MODE", 0) == 0
    assert station.set("MC_AIRMODE", 1) == 1
    assert station.set("RTL_APPR_FORCE", 0) == 0
    ready = mavlink.MAV_SYS_STATUS_PREARM_CHECK
    station.receive("SYS_STATUS", lambda m: m.onboard_control_sensors_health & ready)
    assert station.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1.0, 0.0) == mavlink.MAV_RESULT_ACCEPTED
    assert station.command(mavlink.MAV_CMD_NAV_TAKEOFF) == mavlink.MAV_RESULT_ACCEPTED
    now = station.receive("GLOBAL_POSITION_INT", lambda m: m.relative_alt > 2000).time_boot_ms
    assert (
        station.command(
            mavlink.MAV_CMD_INJECT_FAILURE, mavlink.FAILURE_UNIT_SYSTEM_MOTOR, mavlink.FAILURE_TYPE_WRONG, 1.0
        )
        == mavlink.MAV_RESULT_ACCEPTED
    )
    while (m := station.receive(["GLOBAL_POSITION_INT", "HEARTBEAT"])).get_type() == "HEARTBEAT" or (
        m.time_boot_ms < now + 3000
    ):
        assert m.get_type() != "HEARTBEAT" or (m.system_status != critical and m.base_mode & armed)
    assert station.set("FD_ACT_EN", 1) == 1
    station.receive("HEARTBEAT", lambda m: m.system_status == critical)
