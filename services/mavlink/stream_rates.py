"""Telemetry streams to one endpoint and their due times."""

from heapq import heapify, heappop, heappush
from typing import Any

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
