"""Client of a firmware's MAVLink link, against a scripted vehicle with pymavlink as its codec."""

import math
import struct

import pytest
from pymavlink.dialects.v20 import all as mavlink

from lapwing.dynamics.geodesy import Home
from lapwing.messages import MissionItem, Vector3
from lapwing.services.ardupilot import modes as ardupilot
from lapwing.services.common.firmware.link import LinkReport
from lapwing.services.common.firmware.mission_client import REJECTIONS, MissionClient, Stage, poll_flight
from lapwing.services.common.firmware.program import FirmwareError
from lapwing.services.common.firmware.schema import parameters_in
from lapwing.services.common.mavlink.geo_coordinates import Datum
from lapwing.services.common.mavlink.mission_export import to_mavlink
from lapwing.services.px4 import modes as px4

HOME = Home(40.0, 14.0, 100.0)
ITEMS = (
    MissionItem("takeoff", Vector3(0.0, 0.0, 5.1), math.nan, math.nan, 0.0, ()),
    MissionItem("waypoint", Vector3(10.0, 0.0, 5.1), 0.5 * math.pi, math.nan, 1.0, ()),
)


class Vehicle:
    """Vehicle's end of the link, also the transport."""

    def __init__(self, arm_rejections=0, uploads_rejected=0):
        """Create a vehicle that rejects arming `arm_rejections` times and a mission `uploads_rejected` times."""
        self.codec = mavlink.MAVLink(None, srcSystem=7, srcComponent=1)
        self.reader = mavlink.MAVLink(None)
        self.out, self.items, self.sent = b"", {}, []
        self.parameters = {"COM_RC_IN_MODE": (0, mavlink.MAV_PARAM_TYPE_INT32), "MPC_XY_VEL_MAX": (12.0, 9)}
        self.arm_rejections, self.uploads_rejected, self.count = arm_rejections, uploads_rejected, 0
        self.armed, self.fixed = False, ()

    def receive(self):
        data, self.out = self.out, b""
        return data

    def send(self, data):
        for message in self.reader.parse_buffer(data) or ():
            self.sent.append(message)
            getattr(self, message.get_type().lower(), lambda _: None)(message)

    def emit(self, message):
        self.out += message.pack(self.codec)

    def beat(self, custom_mode=0):
        self.emit(mavlink.MAVLink_heartbeat_message(2, 12, 1 | 128 * self.armed, custom_mode, 4, 3))

    def mission_count(self, message):
        if self.uploads_rejected:
            self.uploads_rejected -= 1
            self.emit(mavlink.MAVLink_mission_ack_message(245, 190, mavlink.MAV_MISSION_NO_SPACE))
            return
        self.count, self.items = message.count, {}
        self.emit(mavlink.MAVLink_mission_request_message(245, 190, 0))

    def mission_item_int(self, message):
        self.items[message.seq] = message
        if len(self.items) < self.count:
            self.emit(mavlink.MAVLink_mission_request_int_message(245, 190, len(self.items)))
        else:
            self.emit(mavlink.MAVLink_mission_ack_message(245, 190, 0))

    def command_long(self, message):
        result = 0
        if message.command == mavlink.MAV_CMD_COMPONENT_ARM_DISARM:
            if self.arm_rejections:
                self.arm_rejections -= 1
                result = mavlink.MAV_RESULT_TEMPORARILY_REJECTED
                self.emit(mavlink.MAVLink_statustext_message(3, b"Preflight Fail: no position"))
            else:
                self.armed = True
        self.emit(mavlink.MAVLink_command_ack_message(message.command, result))

    def param_request_read(self, message):
        if message.param_id in self.parameters:
            self.value(message.param_id, *self.parameters[message.param_id])

    def param_set(self, message):
        if message.param_id in self.fixed:
            return
        value = message.param_value
        if message.param_type == mavlink.MAV_PARAM_TYPE_INT32:
            value = struct.unpack("<i", struct.pack("<f", value))[0]
        self.parameters[message.param_id] = (value, message.param_type)
        self.value(message.param_id, value, message.param_type)

    def value(self, name, value, kind):
        if kind == mavlink.MAV_PARAM_TYPE_INT32:
            value = struct.unpack("<f", struct.pack("<i", value))[0]
        self.emit(mavlink.MAVLink_param_value_message(name.encode(), value, kind, 1, 0))


def fly(vehicle, client, seconds, begin=0.0):
    for k in range(round(seconds / 0.02)):
        if k % 50 == 0:
            vehicle.beat()
        client.poll(begin + 0.02 * k)


def make(vehicle, conventions=px4.CONVENTIONS, parameters=(), **others):
    items = to_mavlink(ITEMS, mavlink.MAV_MISSION_TYPE_MISSION, Datum(HOME, 0.1, 0.1))
    return MissionClient(vehicle, conventions, items, dict(parameters), **others)


def test_mission_is_uploaded_and_started():
    vehicle = Vehicle()
    client = make(vehicle)
    fly(vehicle, client, 3.0)
    assert client.stage is Stage.FLYING
    assert [vehicle.items[k].command for k in range(2)] == [22, 16]
    assert vehicle.items[1].z == pytest.approx(5.0, abs=1e-4)
    assert vehicle.items[1].y > 140000000
    assert vehicle.items[1].param4 == pytest.approx(0.0, abs=1e-9)  # heading north: yaw 90 degrees from east
    assert math.isnan(vehicle.items[0].param4)
    mode = next(m for m in vehicle.sent if getattr(m, "command", 0) == mavlink.MAV_CMD_DO_SET_MODE)
    assert (mode.target_system, mode.param1, mode.param2, mode.param3) == (7, 1, 4, 4)


def test_firmware_is_ready_for_a_second_before_its_mode_changes():
    vehicle, client = (v := Vehicle()), make(v)
    for ready, seconds in ((False, 2.0), (True, 0.9), (False, 0.5)):
        status = [0, 0, mavlink.MAV_SYS_STATUS_PREARM_CHECK * ready, *[0] * 10]
        vehicle.emit(mavlink.MAVLink_sys_status_message(*status))
        fly(vehicle, client, seconds, max(client.next_poll, 0.0))
    commands = {message.command for message in vehicle.sent if message.get_type() == "COMMAND_LONG"}
    assert mavlink.MAV_CMD_RUN_PREARM_CHECKS in commands
    assert commands.isdisjoint({mavlink.MAV_CMD_DO_SET_MODE, mavlink.MAV_CMD_COMPONENT_ARM_DISARM})
    status[2] = mavlink.MAV_SYS_STATUS_PREARM_CHECK
    vehicle.emit(mavlink.MAVLink_sys_status_message(*status))
    fly(vehicle, client, 5.0, client.next_poll)
    assert client.stage is Stage.FLYING


def test_long_status_text_is_one_text():
    vehicle, client = (v := Vehicle(arm_rejections=99)), make(v)
    fly(vehicle, client, 3.0)
    text = "Arming denied: Resolve system health failures first\t"
    for number, chunk in enumerate((text[:50], text[50:])):
        vehicle.emit(mavlink.MAVLink_statustext_message(3, chunk.encode(), 5, number))
    client.read()
    assert text.strip() in client.texts.blockers


def test_ardupilot_has_home_first_and_no_nan():
    vehicle = Vehicle()
    fly(vehicle, make(vehicle, ardupilot.CONVENTIONS), 3.0)
    assert [vehicle.items[k].command for k in range(3)] == [16, 22, 16]
    assert all(math.isfinite(vehicle.items[k].param4) for k in range(3))


def test_parameters_are_set_with_their_types():
    vehicle = Vehicle()
    client = make(vehicle, parameters={"COM_RC_IN_MODE": 4.0, "MPC_XY_VEL_MAX": 5.0})
    fly(vehicle, client, 8.0)
    assert vehicle.parameters["COM_RC_IN_MODE"][0] == 4
    assert vehicle.parameters["MPC_XY_VEL_MAX"][0] == 5.0
    assert client.stage is Stage.FLYING


@pytest.mark.parametrize(("sets", "mode"), [(True, 3), (False, 0)])
def test_parameters_that_firmware_does_not_take_are_reported(sets, mode):
    vehicle = Vehicle()
    vehicle.fixed = ("MPC_XY_VEL_MAX",)
    parameters, optional = {"MPC_XY_VEL_MAX": 5.0, "NO_SUCH": 1.0}, {"OLD_NAME": 1.0, "COM_RC_IN_MODE": 3.0}
    client = make(vehicle, parameters=parameters, sets=sets, optional=optional)
    fly(vehicle, client, 20.0)
    report = LinkReport("px4")
    poll_flight(report, client, 20.1)
    assert sorted(report.notes) == [
        "parameter MPC_XY_VEL_MAX is 12 instead of 5",
        "parameter NO_SUCH is unknown to it",
    ]
    assert client.stage is Stage.FLYING
    assert vehicle.parameters["COM_RC_IN_MODE"][0] == mode


@pytest.mark.parametrize("text", ["MPC_XY_VEL_MAX 5.0  # faster", "MPC_XY_VEL_MAX,5", "1\t1\tMPC_XY_VEL_MAX\t5.0\t9"])
def test_parameter_files_of_ground_stations_are_read(text):
    assert parameters_in(f"# a comment\n{text}\n") == {"MPC_XY_VEL_MAX": 5.0}


def test_rejected_arming_is_retried_and_blockers_reported():
    vehicle = Vehicle(arm_rejections=3)
    client = make(vehicle)
    fly(vehicle, client, 2.5)
    assert client.texts.blockers == ["Preflight Fail: no position"]
    fly(vehicle, client, 10.0, 2.5)
    assert client.stage is Stage.FLYING
    assert client.texts.blockers == []


def test_mission_without_space_is_retried():
    vehicle = Vehicle(uploads_rejected=3)
    client = make(vehicle)
    fly(vehicle, client, 8.0)
    assert client.stage is Stage.FLYING


def test_rejected_mission_ends_run():
    vehicle = Vehicle(uploads_rejected=100)
    client = make(vehicle)
    fly(vehicle, client, REJECTIONS + 5.0)
    with pytest.raises(FirmwareError, match=r"px4: the mission is rejected \(mav_mission_no_space\)"):
        poll_flight(LinkReport("px4"), client, 30.0)


def test_disarming_finishes_flight_and_failsafe_is_reported():
    vehicle = Vehicle()
    client = make(vehicle)
    fly(vehicle, client, 3.0)
    vehicle.beat()
    vehicle.emit(mavlink.MAVLink_statustext_message(3, b"Failsafe activated: RTL\t"))
    assert poll_flight(LinkReport("px4"), client, 3.5).text == "Failsafe activated: RTL"
    vehicle.armed = False
    vehicle.beat()
    assert poll_flight(LinkReport("px4"), client, 4.0).finished


def test_restarted_firmware_gets_mission_and_is_armed():
    vehicle = Vehicle()
    client = make(vehicle, parameters={"MPC_XY_VEL_MAX": 5.0})
    fly(vehicle, client, 5.0)
    assert client.stage is Stage.FLYING
    vehicle.beat()  # last heartbeat of the previous program, armed
    vehicle.armed, vehicle.items = False, {}
    vehicle.parameters["MPC_XY_VEL_MAX"] = (12.0, 9)
    client.restart()
    fly(vehicle, client, 5.0, 5.0)
    assert client.stage is Stage.FLYING
    assert vehicle.armed
    assert len(vehicle.items) == 2
    assert vehicle.parameters["MPC_XY_VEL_MAX"][0] == 5.0


def test_event_names_cause_and_action_of_failsafe():
    vehicle = Vehicle()
    client = make(vehicle)
    fly(vehicle, client, 3.0)
    event = mavlink.mavlink_map[410]
    arguments = struct.pack("<IBB34x", 4, 6, 3)  # mode, return, low battery
    vehicle.emit(event(0, 0, (1 << 24) + 9751178, 30_000, 7, 0x42, tuple(arguments)))
    vehicle.emit(mavlink.MAVLink_statustext_message(2, b"Failsafe activated\t"))
    vehicle.emit(event(0, 0, (1 << 24) + 961599, 30_100, 8, 0x66, (0,) * 40))  # event about sticks
    client.poll(3.5)
    assert client.texts.failsafe == "low battery: return"


def test_other_components_are_ignored():
    vehicle = Vehicle()
    client = make(vehicle)
    gimbal = mavlink.MAVLink(None, srcSystem=7, srcComponent=154)
    vehicle.out = mavlink.MAVLink_heartbeat_message(26, 8, 0, 0, 4, 3).pack(gimbal)
    client.poll(0.0)
    assert client.stage is Stage.CONNECTING


@pytest.mark.parametrize(("mode", "name"), [(4 << 16 | 4 << 24, "mission"), (1 << 16, "manual"), (6 << 16, "offboard")])
def test_px4_mode_names(mode, name):
    assert px4.mode_name(mode) == name


def test_battery_is_sent_as_battery_of_vehicle():
    vehicle = Vehicle()
    client = MissionClient(vehicle, px4.CONVENTIONS, (), {})
    client.send_battery(14.2, 12.5, 0.37)
    assert vehicle.sent == []  # its system id is not known yet
    vehicle.beat()
    client.poll(0.0)
    client.send_battery(14.2, 12.5, 0.37)
    notes = next(m for m in vehicle.sent if m.get_type() == "BATTERY_STATUS")
    assert (notes.get_srcSystem(), notes.get_srcComponent()) == (7, mavlink.MAV_COMP_ID_BATTERY)
    assert notes.voltages[:2] == [14200, 65535]
    assert (notes.current_battery, notes.battery_remaining) == (1250, 37)


def test_version_of_firmware_is_requested():
    vehicle = Vehicle()
    client = MissionClient(vehicle, px4.CONVENTIONS, (), {})
    vehicle.beat()
    client.poll(0.0)
    requested = [m for m in vehicle.sent if m.get_type() == "COMMAND_LONG" and m.command == 512]
    assert [m.param1 for m in requested] == [148.0]
    vehicle.emit(mavlink.MAVLink_autopilot_version_message(0, 0x01110080, 0, 0, 0, [0] * 8, [0] * 8, [0] * 8, 0, 0, 0))
    client.poll(0.1)
    assert client.version == "1.17.0"


def test_firmware_is_asked_once_to_stop_unused_messages():
    vehicle = Vehicle()
    client = MissionClient(vehicle, px4.CONVENTIONS, (), {})
    for k in range(20):
        vehicle.beat()
        vehicle.emit(mavlink.MAVLink_attitude_message(1, 0.1, 0.2, 0.3, 0.0, 0.0, 0.0))
        vehicle.emit(mavlink.MAVLink_vfr_hud_message(*(0,) * 6))
        client.poll(0.1 * k)
    stops = [m.param1 for m in vehicle.sent if m.get_type() == "COMMAND_LONG" and m.param2 == -1.0]
    assert stops == [mavlink.MAVLINK_MSG_ID_ATTITUDE, mavlink.MAVLINK_MSG_ID_VFR_HUD]
    client.restart()
    vehicle.beat()
    client.poll(3.0)
    client.poll(3.1)
    assert [m.param1 for m in vehicle.sent if m.get_type() == "COMMAND_LONG" and m.param2 == -1.0] == 2 * stops
