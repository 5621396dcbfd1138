"""MAVLink adapter with its sockets."""

import selectors
import time
from collections.abc import Callable, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

from lapwing.messages import OperatorInput, header
from lapwing.messages.topics import ESTIMATE, TOPICS, Topic
from lapwing.services.mavlink.adapter import Adapter
from lapwing.services.mavlink.links import Link, open_link
from lapwing.services.mavlink.vehicle_description import VehicleDescription


class Options(NamedTuple):
    """Options of the links of a vehicle."""

    urls: tuple[str, ...]
    key: bytes | None = None  # signs outgoing messages; messages without its signature are rejected
    insecure: bool = False  # True to accept commands from other machines without a key
    log: Path | None = None  # log that endpoints may download
    time_stamps: Path | None = None  # file that keeps the time stamps of signed frames
    speed: float | None = 1.0  # simulated seconds per second; None: as fast as possible


MAX_STEPS = 200_000  # recorded steps


class Pacing:
    """Wall time of each step of the telemetry."""

    def __init__(self, speed: float | None):
        """Create an empty record; `speed`: simulated seconds per second, None for as fast as possible."""
        self._speed = speed
        self._steps: list[tuple[float, float]] = []  # simulation time, wall time [s]

    def note(self, simulated: float, wall: float) -> None:
        """Record the simulation time and wall time [s] of a step."""
        if len(self._steps) < MAX_STEPS:
            self._steps.append((simulated, wall))

    def jitter(self) -> list[float]:
        """Return the deviations of the intervals between steps from the nominal ones [s], sorted."""
        speed = self._speed or 1.0
        return sorted(abs((b[1] - a[1]) - (b[0] - a[0]) / speed) for a, b in pairwise(self._steps))

    def behind(self) -> float:
        """Return the lag of the slowest step behind the fastest [s] of wall time."""
        if self._speed is None or not self._steps:
            return 0.0
        lags = [wall - simulated / self._speed for simulated, wall in self._steps]
        return max(lags) - min(lags)

    def report(self) -> str:
        """Return the line of the final report."""
        jitter = self.jitter()
        if self._speed is None or not jitter:
            return "telemetry: no real-time factor"
        median, p99 = (1e3 * jitter[int(share * (len(jitter) - 1))] for share in (0.5, 0.99))
        return (
            f"telemetry: jitter median {median:.1f} ms, p99 {p99:.1f} ms, worst {1e3 * jitter[-1]:.1f} ms; "
            f"at most {1e3 * self.behind():.0f} ms behind"
        )


class LinkServer:
    """Links of one vehicle; a context manager. The servers of several vehicles share one wait.

    Attributes:
        selector: selector of the sockets of all servers that share the wait.
    """

    def __init__(
        self,
        description: VehicleDescription,
        options: Options,
        operate: Callable[[bytes], None] | None,
        first: "LinkServer | None" = None,
    ):
        """Open every link.

        Args:
            description: vehicle.
            options: URLs and permissions of the links.
            operate: passes an encoded OperatorInput to the autopilot; None for a recorded flight.
            first: server of another vehicle, whose `wait` also serves the sockets of this one.

        Raises:
            ValueError: a link cannot be opened.
        """

        def put(command: Any) -> None:
            assert operate
            operate(OperatorInput(header(0, description.name), (command,)).encode())

        operator = put if operate else None
        self.adapter = Adapter(description, operator, options.key, options.insecure, options.log, options.time_stamps)
        self._pacing = Pacing(options.speed)
        self._topics = {topic.key(description.name): topic for topic in TOPICS}
        self.selector: selectors.BaseSelector = first.selector if first else selectors.DefaultSelector()
        self._owns = first is None
        self._links: list[Link] = []
        try:
            for url in options.urls:
                self._links.append(open_link(url, self.adapter, self.selector))
        except ValueError:
            self.close()
            raise

    def wait(self, seconds: float) -> None:
        """Wait for data of endpoints, at most `seconds`; then serve the endpoints once."""
        ready = self.selector.select(seconds)
        self.adapter.tick(time.monotonic())
        for key, _ in ready:
            key.data()

    def replay(self, key: str, time_ns: int, payload: bytes) -> None:
        """Handle a recorded message, with its topic name in the log; serve the endpoints at each estimate."""
        topic = self._topics.get(key)
        if topic:
            self.handle(topic, time_ns, payload)
        if topic is ESTIMATE:
            self.wait(0.0)

    def handle(self, topic: Topic, time_ns: int, payload: bytes) -> None:
        """Handle a published message of the vehicle."""
        wall = time.monotonic()
        self.adapter.handle(topic, time_ns, payload, wall)
        if topic is ESTIMATE:
            self._pacing.note(time_ns * 1e-9, wall)

    def report(self) -> Sequence[str]:
        """Return the lines of the final report."""
        lines = [self._pacing.report()]
        counts = self.adapter.counts
        if rejected := ", ".join(
            f"{count} {reason}" for reason, count in sorted(counts.items()) if reason != "received"
        ):
            lines.append(f"endpoints: {counts['received']} messages received; {rejected}")
        return lines

    def close(self) -> None:
        """Close every link."""
        for link in self._links:
            link.close()
        if self._owns:
            self.selector.close()
        self.adapter.close()

    def __enter__(self) -> "LinkServer":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
