"""One partner on a link: a ground station, a companion computer, a script."""

from collections.abc import Callable
from typing import Any

from services.mavlink.channel import Channel
from services.mavlink.clock import Instant
from services.mavlink.dialect import mavlink
from services.mavlink.telemetry import STREAMS
from services.mavlink.vehicle import Vehicle

SECOND = 1_000_000_000


class Client:
    """What is known of a partner, and when it is to be sent what."""

    def __init__(self, channel: Channel, local: bool, put: Callable[[bytes], None]):
        """A partner that has not been heard yet.

        Args:
            channel: its frames.
            local: it is on this machine.
            put: sends bytes to it.
        """
        self.local = local
        self.system = self.component = 0  # who it says it is
        self.heartbeat: Instant | None = None  # its last
        self._channel, self._put = channel, put
        self._own: dict[int, int] = {}  # interval [ns] by message that it has asked for; 0: never
        self._onboard = False
        self._intervals: dict[int, int] = {}
        self._due: dict[int, int] = {}

    @property
    def name(self) -> str:
        """ "system/component", as commands bear it."""
        return f"{self.system}/{self.component}"

    def receive(self, data: bytes) -> Any:
        """The sound messages of what has come from it."""
        return self._channel.decode(data)

    def send(self, message: Any) -> None:
        """Send one message."""
        self._put(self._channel.encode(message))

    def introduce(self, vehicle: Vehicle, kind: int, now: Instant) -> None:
        """It has said that it is there, and what it is (MAV_TYPE): a companion computer gets other rates."""
        self.heartbeat = now
        onboard = kind == mavlink.MAV_TYPE_ONBOARD_CONTROLLER
        if not self._intervals or onboard != self._onboard:
            self._onboard = onboard
            self.plan(vehicle)

    def plan(self, vehicle: Vehicle) -> None:
        """Set the intervals of all streams anew."""
        for number, stream in STREAMS.items():
            rate = stream.onboard if self._onboard else stream.ground
            rate = vehicle.flavour.RATES.get(stream.name, rate)
            self._set(vehicle, number, self._own.get(number, round(SECOND / rate) if rate else 0))

    def _set(self, vehicle: Vehicle, number: int, interval: int) -> None:
        if self._intervals.get(number) != interval:
            self._intervals[number] = interval
            self._due[number] = vehicle.time_ns

    def ask_interval(self, vehicle: Vehicle, number: int, interval_us: float) -> None:
        """It wants a stream every so many microseconds; 0: as usual, negative: never."""
        if interval_us == 0.0:
            self._own.pop(number, None)
        else:
            self._own[number] = 0 if interval_us < 0.0 else max(1, round(interval_us * 1e3))
        self.plan(vehicle)

    def interval_us(self, number: int) -> int:
        """Interval of a stream [us], -1 for never."""
        return self._intervals.get(number, 0) // 1000 or -1

    def step(self, vehicle: Vehicle, built: dict[int, Any]) -> None:
        """Send what is due; `built` holds the messages of this moment, which all partners share."""
        now = vehicle.time_ns
        for number, interval in self._intervals.items():
            due = self._due[number]
            if interval and now >= due:
                self._due[number] = max(due + interval, now - interval)  # keeps the mean rate, catches up no more
                if number not in built:
                    built[number] = STREAMS[number].build(vehicle)
                if built[number] is not None:
                    self.send(built[number])
