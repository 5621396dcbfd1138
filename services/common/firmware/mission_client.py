"""Client of a firmware's MAVLink link: sets parameters, uploads a mission, arms, and monitors the flight.

It is polled from the lock step and never waits. All its times are simulation times, so that it does not depend on the
speed of the run. Source: MAVLink guide, "Mission Protocol", "Parameter Protocol", "Command Protocol".
"""

import math
from collections.abc import Callable, Mapping, Sequence
from enum import Enum
from types import MappingProxyType
from typing import Any, NamedTuple

from lapwing.services.common.firmware.link import FirmwareOutput, LinkReport
from lapwing.services.common.firmware.mavlink_transport import Transport
from lapwing.services.common.firmware.parameter_client import RETRY, ParameterClient
from lapwing.services.common.firmware.program import FirmwareError
from lapwing.services.common.firmware.status_texts import StatusTexts
from lapwing.services.common.mavlink.dialect import mavlink
from lapwing.services.common.mavlink.frames import saturate

SYSTEM, COMPONENT = 245, mavlink.MAV_COMP_ID_MISSIONPLANNER  # ids of this client
POLL_EVERY = 0.1  # [s] between two polls
ROUND_OFF = 1e-6  # [s] by which a poll may be early
STATE_EVERY = 200_000.0  # [us] between two EXTENDED_SYS_STATE
REJECTIONS = 20  # rejected uploads, one per second, after which the flight fails
CELLS_UNKNOWN, TEMPERATURE_UNKNOWN = 65535, 32767  # in BATTERY_STATUS
BAD_DATA = -1  # id of the decoder for bytes that are no message
READY = mavlink.MAV_SYS_STATUS_PREARM_CHECK
READY_FOR = 1.0  # [s] ready before its mode changes: PX4 completes its home position meanwhile, in a mission no longer
PATIENCE = 30.0  # [s] after the upload, after which a firmware that is not ready is asked why
CHUNK = 50  # characters of a full STATUSTEXT
STOPS = 4  # most messages that one poll asks the firmware to stop


class Conventions(NamedTuple):
    """Differences between firmwares on their MAVLink links."""

    mission_mode: tuple[float, float]  # parameters 2 and 3 of MAV_CMD_DO_SET_MODE
    home_first: bool  # item 0 of a mission is the home position
    open_value: float  # replaces NaN in the parameters of an item
    bytewise: bool  # integer parameters keep their bytes in the float field
    mode_name: Callable[[int], str]  # name of a heartbeat's custom_mode
    event_text: Callable[[int, bytes], str | None] = lambda number, arguments: None  # of a failsafe; "": only a warning
    parameters: Mapping[str, float] = MappingProxyType({})  # that a mission needs


Stage = Enum("Stage", ["CONNECTING", "PARAMETERS", "UPLOADING", "ARMING", "FLYING", "FINISHED"])
"""Progress of the client."""


class MissionClient:
    """Client that uploads a mission, arms, and monitors the flight.

    Attributes:
        stage: progress.
        armed: state of the last heartbeat.
        landed: state of the last EXTENDED_SYS_STATE.
        mode: name of the flight mode.
        texts: status texts and events.
        error: reason why the flight is impossible, "" as long as it is possible.
        version: version of the firmware, "" until it reports it.
        next_poll: simulation time [s] of the next poll.
    """

    def __init__(
        self,
        transport: Transport,
        conventions: Conventions,
        items: Sequence[Any],
        parameters: Mapping[str, float],
        sets: bool = True,
        optional: Mapping[str, float] = MappingProxyType({}),
    ):
        """Create the client.

        Args:
            transport: link to the firmware.
            conventions: conventions of the firmware.
            items: MISSION_ITEM_INT messages; empty: only monitor the flight.
            parameters: firmware parameters.
            sets: True to set the parameters before the upload, False to compare them: the firmware got them at start.
            optional: further firmware parameters, of which a version may lack some.
        """
        self._transport, self._conventions, self._items = transport, conventions, list(items)
        self._initial = {**optional, **parameters}, conventions.bytewise, sets, optional.keys() - parameters.keys()
        self._codec = mavlink.MAVLink(None, srcSystem=SYSTEM, srcComponent=COMPONENT)
        self._codec.robust_parsing = True
        self._others = set[int]()  # ids of messages without a handler
        self.next_poll = self._beat = self._time = -1.0  # [s] of the next poll, heartbeat, and of this poll
        self.version = ""
        self._reset()

    def _reset(self) -> None:
        """Reset to the state before the first heartbeat."""
        self._parameters = ParameterClient(*self._initial)
        self._target = 0  # system id of the firmware
        self._stopped = set[int]()  # ids of messages that the firmware was asked to stop
        self._sent = -1.0  # [s] of the last request
        self._in_mode = False
        self._arms_from = math.inf  # [s] from when on it arms without being ready, since the rejection names reasons
        self._ready_at = -math.inf  # [s] since when the firmware has been ready, inf: it is not
        self._rejections = 0
        self.stage = Stage.CONNECTING
        self.armed, self.landed, self.mode, self.error = False, True, "", ""
        self.texts, self._chunk = StatusTexts(), ""

    def restart(self) -> None:
        """Start over after a restart of the firmware, which has lost its state; discard its earlier messages."""
        self._transport.receive()
        self._reset()

    def poll(self, time: float) -> None:
        """Read and answer messages at simulation `time` [s]."""
        if time < self.next_poll - ROUND_OFF:
            return
        self.next_poll, self._time = time + POLL_EVERY, time
        self.read()
        self._stop_others()
        if time >= self._beat:
            self._beat = time + 1.0
            self._send(
                mavlink.MAVLink_heartbeat_message(mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, 4, 3)
            )
        if self.connected:
            for message in self._parameters.requests(self._target, time):
                self._send(message)
            if self.stage is Stage.PARAMETERS and self._parameters.done:
                self._advance(Stage.UPLOADING if self._items else Stage.FLYING)
        if time >= self._sent + RETRY or self._sent < 0.0:
            self._sent = time
            self._request()

    @property
    def parameter_problems(self) -> list[str]:
        """A text for each parameter that the firmware did not take."""
        return self._parameters.problems

    def next_poll_tick(self, interval: float) -> int:
        """Return the tick of the next poll; `interval`: [s] of a tick."""
        return math.ceil((self.next_poll - ROUND_OFF) / interval)

    def read(self) -> None:
        """Connect if there is no connection, and process the received messages."""
        for message in self._codec.parse_buffer(self._transport.receive()) or ():
            handler = getattr(self, f"_on_{message.get_type().lower()}", None)
            if handler is None:
                self._others.add(message.get_msgId())
            elif message.get_srcComponent() == mavlink.MAV_COMP_ID_AUTOPILOT1:
                handler(message)

    def _stop_others(self) -> None:
        """Ask the firmware, once for each, to stop messages that have no handler.

        PX4 sends 400 of them per second on its onboard link, which only this client receives. Sending and receiving
        them took a tenth of the CPU time of PX4 and a third of that of Lapwing.
        """
        if self.connected:
            for number in sorted(self._others - self._stopped - {BAD_DATA})[:STOPS]:
                self._stopped.add(number)
                self._command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, number, -1.0)

    @property
    def connected(self) -> bool:
        """Return True once the firmware has sent a heartbeat."""
        return self._target != 0

    def send_parameter(self, name: str, value: float) -> None:
        """Set a parameter of the type float, without waiting for its confirmation."""
        kind = mavlink.MAV_PARAM_TYPE_REAL32
        self._send(mavlink.MAVLink_param_set_message(self._target, 1, name.encode(), value, kind))

    def send_battery(self, voltage: float, current: float, charge: float) -> None:
        """Send the state of the battery [V], [A], fraction, as a battery of the same vehicle does."""
        if not self.connected:
            return
        cells = [saturate(1e3 * voltage, 16, True), *(CELLS_UNKNOWN,) * 9]
        percent = min(max(round(100.0 * charge), 0), 100)
        message = mavlink.MAVLink_battery_status_message(
            0, 0, 0, TEMPERATURE_UNKNOWN, cells, saturate(100.0 * current, 16), -1, -1, percent
        )
        codec = mavlink.MAVLink(None, srcSystem=self._target, srcComponent=mavlink.MAV_COMP_ID_BATTERY)
        self._transport.send(message.pack(codec))

    def _send(self, message: Any) -> None:
        self._transport.send(message.pack(self._codec))

    def _advance(self, stage: Stage) -> None:
        """Enter a stage, and send its first request at once."""
        self.stage, self._sent = stage, -1.0

    def _request(self) -> None:
        """Send the next request of the stage."""
        if self.stage is Stage.UPLOADING:
            count = len(self._items) + self._conventions.home_first
            self._send(mavlink.MAVLink_mission_count_message(self._target, 1, count))
        elif self.stage is Stage.ARMING and self._time < min(self._ready_at, self._arms_from) + READY_FOR:
            self._command(mavlink.MAV_CMD_RUN_PREARM_CHECKS)  # names what is missing
        elif self.stage is Stage.ARMING and self._in_mode:
            self._command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1.0)
        elif self.stage is Stage.ARMING:
            flag = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
            self._command(mavlink.MAV_CMD_DO_SET_MODE, flag, *self._conventions.mission_mode)

    def _command(self, command: int, *parameters: float) -> None:
        padded = (*parameters, *(0.0,) * (7 - len(parameters)))
        self._send(mavlink.MAVLink_command_long_message(self._target, 1, command, 0, *padded))

    def _on_heartbeat(self, message: Any) -> None:
        if message.autopilot == mavlink.MAV_AUTOPILOT_INVALID:
            return
        if self.stage is Stage.CONNECTING:
            self._target = message.get_srcSystem()
            state = mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE
            self._command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, state, STATE_EVERY)
            self._command(mavlink.MAV_CMD_REQUEST_MESSAGE, mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION)
            self._advance(Stage.PARAMETERS)
        was_armed, self.armed = self.armed, bool(message.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED)
        self.mode = self._conventions.mode_name(message.custom_mode)
        if self.armed and self.stage is Stage.ARMING:
            self.texts.arm()
            self._advance(Stage.FLYING)
        if was_armed and not self.armed and self.stage is Stage.FLYING:
            self._advance(Stage.FINISHED)

    def _on_autopilot_version(self, message: Any) -> None:
        number = message.flight_sw_version
        self.version = f"{number >> 24}.{number >> 16 & 0xFF}.{number >> 8 & 0xFF}"

    def _on_extended_sys_state(self, message: Any) -> None:
        self.landed = message.landed_state == mavlink.MAV_LANDED_STATE_ON_GROUND

    def _on_sys_status(self, message: Any) -> None:
        ready = message.onboard_control_sensors_health & READY
        self._ready_at = min(self._ready_at, self._time) if ready else math.inf

    def _on_param_value(self, message: Any) -> None:
        self._parameters.receive(message)

    def _on_mission_request(self, message: Any) -> None:
        number = message.seq - self._conventions.home_first
        if self.stage is not Stage.UPLOADING or not -1 <= number < len(self._items):
            return
        frame, command = mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT, mavlink.MAV_CMD_NAV_WAYPOINT
        values: tuple[float, ...] = (0.0,) * 4  # item -1: the home position, which the firmware knows
        place: tuple[Any, ...] = (0, 0, 0.0)
        if number >= 0:
            item, replacement = self._items[number], self._conventions.open_value
            frame, command, place = item.frame, item.command, (item.x, item.y, item.z)
            values = (item.param1, item.param2, item.param3, item.param4)
            values = tuple(replacement if math.isnan(value) else value for value in values)
        self._send(
            mavlink.MAVLink_mission_item_int_message(
                self._target, 1, message.seq, frame, command, 0, 1, *values, *place
            )
        )

    _on_mission_request_int = _on_mission_request

    def _on_mission_ack(self, message: Any) -> None:
        if self.stage is not Stage.UPLOADING:
            return
        if message.type == mavlink.MAV_MISSION_ACCEPTED:
            self._advance(Stage.ARMING)
            self._arms_from = self._time + PATIENCE
            return
        self._rejections += 1  # ArduPilot has no space for a mission until it has started
        if self._rejections > REJECTIONS:
            entry = mavlink.enums["MAV_MISSION_RESULT"].get(message.type)
            name = entry.name.lower() if entry else message.type
            self.error = f"the mission is rejected ({name}) {self.texts.error}".rstrip()

    def _on_command_ack(self, message: Any) -> None:
        if self.stage is not Stage.ARMING:
            return
        accepted = message.result == mavlink.MAV_RESULT_ACCEPTED
        if message.command == mavlink.MAV_CMD_DO_SET_MODE and accepted and not self._in_mode:
            self._in_mode, self._sent = True, -1.0
        elif message.command == mavlink.MAV_CMD_COMPONENT_ARM_DISARM and not accepted:
            self._in_mode = False  # a rejected mode change may have restored the mode

    def _on_event(self, message: Any) -> None:
        text = self._conventions.event_text(message.id, bytes(message.arguments))
        if self.armed and text is not None:
            self.texts.add_event(text)

    def _on_statustext(self, message: Any) -> None:
        self._chunk = message.text if message.id == 0 or message.chunk_seq == 0 else self._chunk + message.text
        if message.id == 0 or len(message.text) < CHUNK:  # else another chunk follows
            text = self._chunk.strip()  # PX4 ends texts that it also sends as events with a tab
            self.texts.add(text, message.severity, self.armed, self.stage is Stage.ARMING)


def poll_flight(report: LinkReport, client: MissionClient, time: float) -> FirmwareOutput:
    """Poll the client at simulation `time` [s]. Return the state of the flight, without outputs.

    The version of the firmware and the parameters that it did not take go to the report.

    Raises:
        FirmwareError: the firmware rejects the mission.
    """
    client.poll(time)
    if client.error:
        raise FirmwareError(f"{report.firmware}: {client.error} at t = {time:.3f} s; change the mission")
    report.version = client.version
    for text in client.parameter_problems:
        report.note(text)
    failsafe, finished = client.texts.failsafe if client.armed else "", client.stage is Stage.FINISHED
    blockers = tuple(client.texts.blockers)
    return FirmwareOutput((), client.armed, client.landed, finished, client.mode, failsafe, blockers)
