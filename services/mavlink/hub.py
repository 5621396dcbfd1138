"""An adapter with its sockets: waits for clients and for the vehicle at once, and lets neither starve the other."""

import selectors
import socket
import time
from collections.abc import Callable, Iterable, Sequence
from typing import Any, NamedTuple

from messages import OperatorInput
from messages.topics import ESTIMATE, TOPICS, Topic
from services.mavlink.adapter import Adapter
from services.mavlink.lateness import Lateness
from services.mavlink.links import open_link
from services.mavlink.place import prepare
from services.mavlink.vehicle import Vehicle
from services.parameters import Parameter

WAIT = 0.05  # [s] at most until something else is looked at


class Options(NamedTuple):
    """How a run is linked to the outside."""

    urls: tuple[str, ...]
    key: bytes | None = None
    insecure: bool = False
    speed: float | None = 1.0  # simulated seconds per second


class Hub:
    """Links of one vehicle; a context manager."""

    def __init__(
        self,
        vehicle: Vehicle,
        options: Options,
        parameters: Iterable[Parameter],
        operate: Callable[[bytes], None] | None,
    ):
        """Open every link.

        Args:
            vehicle: what flies.
            options: the links, and who may command.
            parameters: what can be tuned.
            operate: hands an encoded OperatorInput to the autopilot; None for a recorded flight.

        Raises:
            ValueError: a link cannot be opened.
        """

        def put(command: Any) -> None:
            assert operate
            operate(OperatorInput(commands=(command,)).encode())

        operator = put if operate else None
        self.adapter = Adapter(vehicle, tuple(parameters), operator, options.key, options.insecure)
        self.lateness = Lateness(options.speed)
        self._topics = {topic.key(vehicle.name): topic for topic in TOPICS}
        self._selector = selectors.DefaultSelector()
        self._woken, self._wake = socket.socketpair()
        self._woken.setblocking(False)
        self._wake.setblocking(False)
        self._selector.register(self._woken, selectors.EVENT_READ, self._drain)
        self._links: list = []
        prepare()
        try:
            for url in options.urls:
                self._links.append(open_link(url, self.adapter, self._selector))
        except ValueError:
            self.close()
            raise

    def wake(self) -> None:
        """End the present wait; may be called from any thread."""
        try:
            self._wake.send(b"\0")
        except OSError:  # as many wake-ups as fit are on their way, or this is the end
            return

    def _drain(self) -> None:
        self._woken.recv(4096)

    def wait(self, seconds: float = WAIT) -> None:
        """Serve the clients once, as soon as there is something; or until woken, or for so long."""
        ready = self._selector.select(seconds)
        self.adapter.tick(time.monotonic())
        for key, _ in ready:
            key.data()

    def replay(self, key: str, time_ns: int, payload: bytes) -> None:
        """A recorded message of a topic, by its name in the log; serves the clients now and then."""
        topic = self._topics.get(key)
        if topic:
            self.take(topic, time_ns, payload)
        if topic is ESTIMATE:
            self.wait(0.0)

    def take(self, topic: Topic, time_ns: int, payload: bytes) -> None:
        """The vehicle has published a message."""
        wall = time.monotonic()
        self.adapter.take(topic, time_ns, payload, wall)
        if topic is ESTIMATE:
            self.lateness.note(time_ns * 1e-9, wall)

    def report(self) -> Sequence[str]:
        """What there is to tell at the end."""
        lines = [self.lateness.report()]
        counts = self.adapter.counts
        if refused := ", ".join(f"{count} {what}" for what, count in sorted(counts.items()) if what != "received"):
            lines.append(f"clients: {counts['received']} messages received; {refused}")
        return lines

    def close(self) -> None:
        """Close every link."""
        for link in self._links:
            link.close()
        self._selector.close()
        self._woken.close()
        self._wake.close()

    def __enter__(self) -> "Hub":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
