"""Conversation with one endpoint, the argument of every protocol handler: its telemetry streams and log downloads."""

from collections import Counter
from collections.abc import Callable, Sequence
from heapq import heapify, heappop, heappush
from pathlib import Path
from typing import Any, NamedTuple

from lapwing.services.common.mavlink.dialect import mavlink
from lapwing.services.mavlink.announcements import statustext
from lapwing.services.mavlink.clock import Clock, Instant
from lapwing.services.mavlink.command_queue import CommandQueue, OnAcknowledgement
from lapwing.services.mavlink.component_metadata import files
from lapwing.services.mavlink.endpoint import Endpoint
from lapwing.services.mavlink.file_server import FileServer
from lapwing.services.mavlink.mission_store import MissionStore
from lapwing.services.mavlink.parameter_store import ParameterStore
from lapwing.services.mavlink.setpoint_keeper import SetpointKeeper
from lapwing.services.mavlink.telemetry import streams
from lapwing.services.mavlink.telemetry.message_stream import Builder, as_list
from lapwing.services.mavlink.vehicle_cache import VehicleCache

SECOND = 1_000_000_000
MAX_INTERVAL = 0x7FFFFFFF * 1000  # [ns] largest value of MESSAGE_INTERVAL

_Member = tuple[int, int, Builder]  # rank, message, builder
_Group = tuple[int, int, int, list[_Member]]  # due time [ns], number of the group, interval [ns], messages by rank


class Schedule:
    """Intervals of the streams to one endpoint: defaults, or those that the endpoint has requested."""

    def __init__(self, vehicle: VehicleCache):
        """Create the intervals of a ground station, all due now."""
        self._vehicle = vehicle
        self._requested: dict[int, int] = {}  # requested interval [ns] by message; 0: never
        self._onboard = False
        self._intervals: dict[int, int] = {}
        self._due: dict[int, int] = {}
        self._queue: list[_Group] = []  # heap; without the messages that are never sent
        self._plan()

    def set_onboard(self, onboard: bool) -> None:
        """Select the rates of a companion computer or of a ground station."""
        if onboard != self._onboard:
            self._onboard = onboard
            self._plan()

    def set_interval(self, number: int, interval_us: float) -> None:
        """Set the interval of a message [us]; 0: default, negative: never.

        Raises:
            OverflowError: an infinite interval.
        """
        if interval_us == 0.0:
            self._requested.pop(number, None)
        else:
            self._requested[number] = 0 if interval_us < 0.0 else max(1, min(MAX_INTERVAL, round(interval_us * 1e3)))
        self._plan()

    def interval_us(self, number: int) -> int:
        """Return the interval of a message [us]; -1: never."""
        return self._intervals.get(number, 0) // 1000 or -1

    def due(self, built: dict[int, list[Any]]) -> list[Any]:
        """Return the messages that are due; `built` caches messages of this time for all endpoints."""
        vehicle, queue = self._vehicle, self._queue
        now = vehicle.time_ns
        ready: list[_Group] = []
        while queue and queue[0][0] <= now:
            ready.append(heappop(queue))
        members: list[_Member] = []
        for due_ns, order, interval, group in ready:
            members += group
            heappush(queue, (max(due_ns + interval, now - interval), order, interval, group))  # mean rate, no bursts
        if len(ready) > 1:
            members.sort()
        messages: list[Any] = []
        for _, number, build in members:
            if number not in built:
                built[number] = as_list(build(vehicle))
            messages += built[number]
        return messages

    def _plan(self) -> None:
        """Set all intervals, and group the streams that are always due together."""
        for due_ns, _, _, members in self._queue:
            self._due.update((number, due_ns) for _, number, _ in members)
        groups: dict[tuple[int, int], list[_Member]] = {}
        for rank, (number, stream) in enumerate(streams().items()):
            rate = stream.onboard if self._onboard else stream.ground
            rate = self._vehicle.firmware.RATES.get(stream.name, rate)
            interval = self._requested.get(number, round(SECOND / rate) if rate else 0)
            if self._intervals.get(number) != interval:
                self._intervals[number] = interval
                self._due[number] = self._vehicle.time_ns
            if interval:
                groups.setdefault((self._due[number], interval), []).append((rank, number, stream.build))
        self._queue = [(due_ns, k, interval, group) for k, ((due_ns, interval), group) in enumerate(groups.items())]
        heapify(self._queue)


NUMBER = 1  # number of the only log
PIECE = 90  # [bytes] of one LOG_DATA
PER_STEP = 100  # messages at each step of the telemetry


class LogServer:
    """Server that lists the log and sends the requested bytes, a few messages at a time."""

    def __init__(self, path: Path | None):
        """Create a server of the log at `path`; None: no log."""
        self._path = path
        self._next = self._end = 0  # [bytes] range that remains to be sent
        self._due = False  # a request needs a reply, which may be empty

    @property
    def _size(self) -> int:
        try:
            return self._path.stat().st_size if self._path else 0
        except OSError:
            return 0

    def entries(self, first: int, last: int) -> Any:
        """Return LOG_ENTRY messages of a range of logs, with the size written so far."""
        if self._path is None or not self._size or not first <= NUMBER <= last:
            return mavlink.MAVLink_log_entry_message(0, 0, 0, 0, 0)
        return mavlink.MAVLink_log_entry_message(NUMBER, 1, NUMBER, int(self._path.stat().st_mtime), self._size)

    def request(self, number: int, offset: int, count: int) -> None:
        """Start to send `count` bytes from an offset; this replaces the previous request."""
        self._next = offset
        self._end = min(self._size, offset + count) if number == NUMBER else offset
        self._end = max(self._end, offset)
        self._due = True

    def stop(self) -> None:
        """Cancel the request."""
        self._next = self._end = 0
        self._due = False

    def step(self) -> Sequence[Any]:
        """Return the next LOG_DATA messages."""
        if not self._due:
            return ()
        messages = []
        data = self._read(self._next, min(PER_STEP * PIECE, self._end - self._next))
        for start in range(0, max(1, len(data)), PIECE):
            piece = data[start : start + PIECE]
            padded = list(piece.ljust(PIECE, b"\0"))
            messages.append(mavlink.MAVLink_log_data_message(NUMBER, self._next + start, len(piece), padded))
        self._next += len(data)
        self._due = bool(data) and self._next < self._end
        return messages

    def _read(self, offset: int, count: int) -> bytes:
        if self._path is None or count <= 0:
            return b""
        try:
            with self._path.open("rb") as file:
                file.seek(offset)
                return file.read(count)
        except OSError:
            return b""


TEXT_PERIOD, MAX_TEXTS = 5.0, 64  # [s] between two equal texts; number of texts that are stored


class LinkState(NamedTuple):
    """State that the conversations with all endpoints share."""

    vehicle: VehicleCache
    clock: Clock
    commands: CommandQueue
    parameters: ParameterStore
    missions: MissionStore
    setpoints: SetpointKeeper
    sticks: SetpointKeeper
    counts: Counter[str]  # rejected messages by reason
    log: Path | None  # log of the run
    trusts: Callable[[Endpoint], bool]  # returns True if commands of an endpoint are accepted
    restart: Callable[[], None]  # restarts the link after the present message


class Session:
    """Conversation with one endpoint."""

    def __init__(self, endpoint: Endpoint, link: LinkState):
        """Start a conversation."""
        self.endpoint, self._link = endpoint, link
        self.vehicle, self.clock, self.restart = link.vehicle, link.clock, link.restart
        self.parameters, self.missions = link.parameters, link.missions
        self.schedule = Schedule(link.vehicle)
        self.log = LogServer(link.log)
        self.files = FileServer(files(link.vehicle.description))
        self._sent_texts: dict[str, Instant] = {}

    @property
    def address(self) -> tuple[int, int]:
        """System and component id of the endpoint, the target of messages to it."""
        return self.endpoint.system, self.endpoint.component

    @property
    def trusted(self) -> bool:
        """True if the endpoint's commands are accepted; counts a rejection."""
        return self._link.trusts(self.endpoint)

    def send(self, message: Any) -> None:
        """Send a message to the endpoint."""
        self.endpoint.send(message)

    def command(
        self, kind: str, values: Sequence[float] = (), on_acknowledgement: OnAcknowledgement | None = None
    ) -> None:
        """Queue a command to the autopilot; it must be trusted. `on_acknowledgement` receives every acknowledgement."""
        self._link.commands.put(kind, self.endpoint.name, on_acknowledgement, values)

    def offboard(self, kind: str, values: Sequence[float]) -> None:
        """Queue an offboard setpoint; it must be trusted."""
        self.command(kind, values)
        self._link.setpoints.hold(kind, self.endpoint.name, values)

    def sticks(self, values: Sequence[float]) -> None:
        """Queue stick positions; they must be trusted."""
        self.command("manual", values)
        self._link.sticks.hold("manual", self.endpoint.name, values)

    def send_text(self, text: str) -> None:
        """Send the reason of a rejection to this endpoint only, the same text at most every `TEXT_PERIOD` seconds."""
        last_sent = self._sent_texts.get(text)
        if last_sent is None or self.clock.since(last_sent) > TEXT_PERIOD:
            if len(self._sent_texts) >= MAX_TEXTS:
                self._sent_texts.clear()
            self._sent_texts[text] = self.clock.now
            for message in statustext(mavlink.MAV_SEVERITY_WARNING, text):
                self.endpoint.send(message)

    def count(self, reason: str) -> None:
        """Count a rejected message."""
        self._link.counts[reason] += 1
