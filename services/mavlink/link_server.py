"""MAVLink adapter with its sockets."""

import selectors
import time
from collections.abc import Callable, Sequence
from typing import Any

from lapwing.messages import OperatorInput, header
from lapwing.messages.topics import ESTIMATE, TOPICS, Topic
from lapwing.services.mavlink.adapter import Adapter
from lapwing.services.mavlink.link_options import Options
from lapwing.services.mavlink.links import Link, open_link
from lapwing.services.mavlink.telemetry_timing import Pacing
from lapwing.services.mavlink.vehicle_description import VehicleDescription


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
