"""Messages sent to all endpoints on a change: mode, mission item, events, texts."""

from collections.abc import Callable, Iterator, Sequence
from typing import Any

from lapwing.services.common.mavlink.dialect import id_of, mavlink
from lapwing.services.common.status_texts import ROUTINE, TAKEN_OVER
from lapwing.services.mavlink.events import Definition, new_detectors
from lapwing.services.mavlink.telemetry import streams
from lapwing.services.mavlink.vehicle_cache import VehicleCache

NO_ITEM = 0xFFFF  # Status.mission_reached before the first


class Announcements:
    """Detector of changes between two statuses of the autopilot."""

    def __init__(self, vehicle: VehicleCache, broadcast: Callable[[Any], None]):
        """Create the detector; `broadcast` sends a message to every endpoint."""
        self._vehicle, self._broadcast = vehicle, broadcast
        self._mode: tuple = ()
        self._home = vehicle.home_world
        self._item = (0, 0)
        self._reached = NO_ITEM
        self._texts = 0
        self._event_text = ""  # text of a failsafe that an event has reported
        self._detectors = new_detectors() if vehicle.firmware.EVENTS else []

    def step(self) -> None:
        """Send the changes since the last status."""
        s = self._vehicle.status
        if (mode := (s.mode, s.armed, s.failsafe)) != self._mode:
            self._mode = mode
            self._event_text = TAKEN_OVER.format(s.text, s.mode) if s.failsafe else ""
            self._send("HEARTBEAT")
            self._send("EXTENDED_SYS_STATE")
        if (home := self._vehicle.home_world) != self._home:
            self._home = home
            self._send("HOME_POSITION")
        if s.mission_reached != self._reached:
            self._announce_reached(s.mission_reached, s.mission_count)

        if (item := (s.mission_current, s.mission_state)) != self._item:
            self._item = item
            self._send("MISSION_CURRENT")
        for detector in self._detectors:
            for definition, values in detector.step(self._vehicle):
                self._announce_event(definition, values)

    def _announce_event(self, definition: Definition, values: Sequence[int]) -> None:
        log, time_ms = self._vehicle.events, self._vehicle.boot_ms
        for message in log.add(definition.id, definition.level, definition.encode(values), time_ms):
            self._broadcast(message)

    def _announce_reached(self, reached: int, count: int) -> None:
        """Announce each reached item separately, also if a status skipped some."""
        first = self._item[0] if self._reached == NO_ITEM else self._reached + 1
        self._reached = reached
        if count and reached != NO_ITEM:
            for number in range(min(first, reached), reached + 1):
                self._broadcast(mavlink.MAVLink_mission_item_reached_message(number))

    def send_text(self, text: str) -> None:
        """Send a text to all endpoints, in pieces if it is long.

        A text that an event also reports ends with a tab, as in PX4: ground stations that read events do not show it.
        """
        failsafe = self._vehicle.status.failsafe
        severity = mavlink.MAV_SEVERITY_CRITICAL if failsafe else mavlink.MAV_SEVERITY_WARNING
        if text in ROUTINE:
            severity = mavlink.MAV_SEVERITY_INFO
        if self._detectors and (text in ROUTINE or text == self._event_text):
            text, self._event_text = f"{text}\t", ""
        self._texts = self._texts % 0xFFFF + 1
        for message in statustext(severity, text, self._texts):
            self._broadcast(message)

    def _send(self, name: str) -> None:
        number = id_of(name)
        for message in streams()[number].messages(self._vehicle) if number is not None else ():
            self._broadcast(message)


TEXT_LENGTH = 50  # [bytes] of one STATUSTEXT


def statustext(severity: int, text: str, number: int = 1) -> Iterator[Any]:
    """Yield the messages of a text; `number` (not 0) identifies the pieces of a long one."""
    data = text.encode()
    text_id = number if len(data) > TEXT_LENGTH else 0
    for piece, start in enumerate(range(0, len(data), TEXT_LENGTH)):
        yield mavlink.MAVLink_statustext_message(severity, data[start : start + TEXT_LENGTH], text_id, piece)
