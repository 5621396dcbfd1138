"""PX4's parameters set over a real MAVLink connection to a running process, and their effects."""

import math
import struct
import subprocess
import sys

import pytest
from fake_vehicle import free_port
from pymavlink import mavutil

from lapwing.services.common.mavlink.dialect import mavlink
from tests.commands import run_command

pytestmark = pytest.mark.long

WAIT = 300.0  # [s] for a message on a busy machine
INTEGER, REAL = mavlink.MAV_PARAM_TYPE_INT32, mavlink.MAV_PARAM_TYPE_REAL32
OUT_OF_RANGE, TYPE_MISMATCH = mavlink.MAV_PARAM_ERROR_VALUE_OUT_OF_RANGE, 7


def as_float(value):
    """Return an integer as in the float field of PX4's messages."""
    return struct.unpack("<f", struct.pack("<i", value))[0]


def lapwing(*arguments):
    """Run a command, and return its output."""
    return run_command(*arguments, code=0).stdout


class Station:
    """Ground station of a run."""

    def __init__(self, port, process):
        self.process = process
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
        self.link.mav.param_set_send(1, 1, name.encode(), as_float(value), mavlink.MAV_PARAM_TYPE_INT32)
        message = self.receive("PARAM_VALUE", lambda m: m.param_id == name)
        return struct.unpack("<i", struct.pack("<f", message.param_value))[0]

    def error(self, name, value, kind):
        """Set a parameter, and return the error that the vehicle reports."""
        self.link.mav.param_set_send(1, 1, name.encode(), value, kind)
        return self.receive("PARAM_ERROR", lambda m: m.param_id == name).error

    def take_off(self):
        """Arm when the vehicle is ready, and climb."""
        ready = mavlink.MAV_SYS_STATUS_PREARM_CHECK
        self.receive("SYS_STATUS", lambda m: m.onboard_control_sensors_health & ready)
        assert self.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1.0, 0.0) == mavlink.MAV_RESULT_ACCEPTED
        assert self.command(mavlink.MAV_CMD_NAV_TAKEOFF) == mavlink.MAV_RESULT_ACCEPTED
        return self.receive("GLOBAL_POSITION_INT", lambda m: m.relative_alt > 2000)

    def command(self, number, *params):
        """Send a command, and return its final result."""
        nan = float("nan")
        self.link.mav.command_long_send(1, 1, number, 0, *params, *[nan] * (7 - len(params)))
        return self.receive("COMMAND_ACK", lambda m: m.command == number and m.result != 5).result


@pytest.fixture
def station(tmp_path, request):
    """Return the ground station of a run; an indirect parameter has further arguments of the command."""
    port = free_port()
    command = [sys.executable, "-m", "lapwing", "run", "groundstation", "--mavlink", f"udpout:127.0.0.1:{port}"]
    command += ["--speed", "5", "--key-prefix", "test-px4-parameters", "--log", str(tmp_path / "flight.mcap")]
    command += getattr(request, "param", [])
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
        result = Station(port, process)
        yield result
        process.terminate()
        process.wait(WAIT)
    result.link.close()


@pytest.mark.nightly
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


@pytest.mark.nightly
def test_address_and_type_of_vehicle_are_set(station):
    armed = mavlink.MAV_MODE_FLAG_SAFETY_ARMED
    assert station.set("MAV_TYPE", mavlink.MAV_TYPE_HEXAROTOR) == mavlink.MAV_TYPE_HEXAROTOR
    station.receive("HEARTBEAT", lambda m: m.type == mavlink.MAV_TYPE_HEXAROTOR)
    for name, value in (("MAV_TYPE", mavlink.MAV_TYPE_FIXED_WING), ("MAV_SYS_ID", 251)):
        assert station.error(name, as_float(value), INTEGER) == OUT_OF_RANGE
        station.receive("PARAM_VALUE", lambda m, name=name: m.param_id == name)
    assert station.set("MAV_SYS_ID", 42) == 42
    station.receive("HEARTBEAT", lambda m: m.get_srcSystem() == 1)
    reboot = mavlink.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN
    station.take_off()
    assert station.command(reboot, 1.0) == mavlink.MAV_RESULT_DENIED
    assert station.command(mavlink.MAV_CMD_NAV_LAND) == mavlink.MAV_RESULT_ACCEPTED
    station.receive("HEARTBEAT", lambda m: not m.base_mode & armed and m.get_srcSystem() == 1)
    assert station.command(reboot, 1.0) == mavlink.MAV_RESULT_ACCEPTED
    station.receive("HEARTBEAT", lambda m: m.get_srcSystem() == 42)
    station.receive("GLOBAL_POSITION_INT", lambda m: m.get_srcSystem() == 42)
    station.link.mav.param_set_send(42, 1, b"MIS_TAKEOFF_ALT", 4.0, REAL)
    message = station.receive("PARAM_VALUE", lambda m: m.param_id == "MIS_TAKEOFF_ALT")
    assert (message.get_srcSystem(), message.param_value) == (42, 4.0)


@pytest.mark.nightly
def test_arming_does_not_require_optional_sensor(station):
    arm = mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1.0, 0.0
    ready = mavlink.MAV_SYS_STATUS_PREARM_CHECK
    station.receive("SYS_STATUS", lambda m: m.onboard_control_sensors_health & ready)
    off = mavlink.FAILURE_UNIT_SENSOR_BARO, mavlink.FAILURE_TYPE_OFF
    assert station.command(mavlink.MAV_CMD_INJECT_FAILURE, *off) == mavlink.MAV_RESULT_ACCEPTED
    station.receive("SYS_STATUS", lambda m: not m.onboard_control_sensors_health & ready)
    assert station.command(*arm) != mavlink.MAV_RESULT_ACCEPTED
    assert station.set("SYS_HAS_BARO", 0) == 0
    station.receive("SYS_STATUS", lambda m: m.onboard_control_sensors_health & ready)
    assert station.command(*arm) == mavlink.MAV_RESULT_ACCEPTED


@pytest.mark.parametrize("station", [["--set", "autopilot.parameters.SYS_HAS_GPS=0"]], indirect=True)
def test_autopilot_without_gps_rejects_arming(station):
    gps = mavlink.MAV_SYS_STATUS_SENSOR_GPS
    station.receive("SYS_STATUS", lambda m: not m.onboard_control_sensors_health & gps)
    assert station.set("SYS_HAS_GPS", 1) == 1  # at the next start
    start = station.receive("GLOBAL_POSITION_INT").time_boot_ms
    station.receive("GLOBAL_POSITION_INT", lambda m: m.time_boot_ms > start + 5000)
    assert not station.receive("SYS_STATUS").onboard_control_sensors_health & gps
    assert station.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1.0, 0.0) != mavlink.MAV_RESULT_ACCEPTED


@pytest.mark.nightly
def test_vehicle_lands_after_loss_of_link_and_by_command(station):
    """Three flights: the station sends no heartbeat after its first, LAND, and RTL, which is overhead."""
    armed = mavlink.MAV_MODE_FLAG_SAFETY_ARMED
    station.take_off()
    assert station.set("NAV_DLL_ACT", 2) == 2  # return; in flight, because the link is lost already
    station.receive("HEARTBEAT", lambda m: not m.base_mode & armed)
    assert station.set("NAV_DLL_ACT", 0) == 0
    for number in (mavlink.MAV_CMD_NAV_LAND, mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH):
        station.take_off()
        assert station.command(number) == mavlink.MAV_RESULT_ACCEPTED
        station.receive("HEARTBEAT", lambda m: not m.base_mode & armed)
        station.receive("EXTENDED_SYS_STATE", lambda m: m.landed_state == mavlink.MAV_LANDED_STATE_ON_GROUND)
    place = station.receive("LOCAL_POSITION_NED")
    assert math.dist((place.x, place.y, place.z), (0.0, 0.0, 0.0)) < 1.0


@pytest.mark.nightly
@pytest.mark.parametrize("station", [["--set", "effects.payload_release={}"]], indirect=True)
def test_disabled_gripper_fails(station):
    release = mavlink.MAV_CMD_DO_GRIPPER, 1.0, mavlink.GRIPPER_ACTION_RELEASE
    assert station.set("PD_GRIPPER_EN", 0) == 0
    assert station.command(*release) == mavlink.MAV_RESULT_FAILED
    station.link.mav.param_set_send(1, 1, b"PD_GRIPPER_EN", as_float(1), INTEGER)
    station.receive("PARAM_VALUE", lambda m: m.param_id == "PD_GRIPPER_EN" and m.param_value == as_float(1))
    assert station.command(*release) == mavlink.MAV_RESULT_ACCEPTED


@pytest.mark.nightly
def test_detection_of_motor_failures_is_switched_in_flight(station):
    critical, armed = mavlink.MAV_STATE_CRITICAL, mavlink.MAV_MODE_FLAG_SAFETY_ARMED
    assert station.set("FD_ACT_EN", 0) == 0
    assert station.set("CA_FAILURE_MODE", 0) == 0
    assert station.set("RTL_APPR_FORCE", 0) == 0
    now = station.take_off().time_boot_ms
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


WHOLE = (
    "MC_AIRMODE CA_FAILURE_MODE FD_ACT_EN COM_RCL_EXCEPT NAV_RCL_ACT GF_ACTION COM_LOW_BAT_ACT COM_ACT_FAIL_ACT "
    "RTL_APPR_FORCE SIM_GPS_USED COM_RC_IN_MODE"
)


def test_hostile_values_are_answered_by_errors(station):
    for name in WHOLE.split():
        for value in (-1, 99, 2**31 - 1, -(2**31)):
            assert station.error(name, as_float(value), INTEGER) == OUT_OF_RANGE
        for value in (math.nan, 1.0):
            assert station.error(name, value, REAL) == TYPE_MISMATCH
    for name in ("COM_RC_LOSS_T", "GF_MAX_HOR_DIST", "GF_MAX_VER_DIST"):
        for value in (math.nan, math.inf, -math.inf, -1.0, 1e9):
            assert station.error(name, value, REAL) == OUT_OF_RANGE
        assert station.error(name, as_float(3), INTEGER) == TYPE_MISMATCH
    assert station.error("SYS_AUTOSTART", as_float(1), INTEGER) == mavlink.MAV_PARAM_ERROR_READ_ONLY
    station.receive("HEARTBEAT")


def test_air_mode_fence_and_sticks_act_and_are_saved(station, tmp_path):
    assert station.set("MC_AIRMODE", 0) == 0
    assert station.set("NAV_RCL_ACT", 3) == 3
    station.take_off()
    assert station.set("MC_AIRMODE", 2) == 2
    assert station.set("GF_ACTION", 2) == 2
    station.link.mav.param_set_send(1, 1, b"GF_MAX_VER_DIST", 1.0, REAL)
    station.receive("STATUSTEXT", lambda m: m.text.startswith("the vehicle is too high above home: hold"))
    station.link.mav.manual_control_send(1, 0, 0, 500, 0, 0)  # once: then the sticks are lost
    station.receive("STATUSTEXT", lambda m: m.text.startswith("the sticks are lost: land"))
    armed = mavlink.MAV_MODE_FLAG_SAFETY_ARMED
    station.receive("HEARTBEAT", lambda m: not m.base_mode & armed)
    station.process.terminate()
    station.process.wait(WAIT)
    saved, log = tmp_path / "saved.params", tmp_path / "next.mcap"
    lapwing("parameters", tmp_path / "flight.mcap", "--save", saved)
    following = ["--set", f"autopilot.parameters={saved}", "--set", "run.duration=0.2"]
    lapwing("run", "groundstation", "--mode", "single-process", *following, "--log", log)
    printed = [line.split()[:2] for line in lapwing("parameters", log).splitlines()]
    assert ["MC_AIRMODE", "2"] in printed
    assert ["NAV_RCL_ACT", "3"] in printed
