"""Telemetry streams to one endpoint and their due times."""

from heapq import heapify, heappop, heappush
from typing import Any

from lapwing.services.mavlink.telemetry import streams
from lapwing.services.mavlink.vehicle_cache import VehicleCache

SECOND = 1_000_000_000
MAX_INTERVAL = 0x7FFFFFFF * 1000  # [ns] largest value of MESSAGE_INTERVAL


class Schedule:
    """Intervals of the streams to one endpoint: defaults, or those that the endpoint has requested."""

    def __init__(self, vehicle: VehicleCache):
        """Create the intervals of a ground station, all due now."""
        self._vehicle = vehicle
        self._requested: dict[int, int] = {}  # requested interval [ns] by message; 0: never
        self._onboard = False
        self._intervals: dict[int, int] = {}
        self._due: dict[int, int] = {}
        self._queue: list[tuple[int, int, int]] = []  # heap: due time [ns], rank, message; without those never sent
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
        now, queue = self._vehicle.time_ns, self._queue
        ready: list[tuple[int, int, int]] = []  # rank, message, due time [ns]
        while queue and queue[0][0] <= now:
            due_ns, rank, number = heappop(queue)
            ready.append((rank, number, due_ns))
        ready.sort()
        messages: list[Any] = []
        for rank, number, due_ns in ready:
            interval = self._intervals[number]
            due_ns = self._due[number] = max(due_ns + interval, now - interval)  # the mean rate without bursts
            heappush(queue, (due_ns, rank, number))
            if number not in built:
                built[number] = streams()[number].messages(self._vehicle)
            messages += built[number]
        return messages

    def _plan(self) -> None:
        """Set all intervals."""
        for number, stream in streams().items():
            rate = stream.onboard if self._onboard else stream.ground
            rate = self._vehicle.firmware.RATES.get(stream.name, rate)
            interval = self._requested.get(number, round(SECOND / rate) if rate else 0)
            if self._intervals.get(number) != interval:
                self._intervals[number] = interval
                self._due[number] = self._vehicle.time_ns
        ranks = enumerate(self._intervals.items())
        self._queue = [(self._due[number], rank, number) for rank, (number, interval) in ranks if interval]
        heapify(self._queue)
