"""An endpoint of a link: a ground station, a companion computer, a script."""

from collections.abc import Callable, Iterator
from typing import Any

from lapwing.services.mavlink.channel import Channel
from lapwing.services.mavlink.clock import Instant

MAX_DATAGRAM = 1400  # [bytes] that networks transmit without fragmentation


class Endpoint:
    """A MAVLink peer and the connection to it."""

    def __init__(self, channel: Channel, local: bool, put: Callable[[bytes], None]):
        """Create an endpoint that has sent nothing yet.

        Args:
            channel: codec of its frames.
            local: True if it is on this machine.
            put: sends bytes to it.
        """
        self.local = local
        self.system = self.component = 0  # ids in its messages
        self.last_heartbeat: Instant | None = None
        self._channel, self._put = channel, put

    @property
    def name(self) -> str:
        """ "system/component", the source of its commands."""
        return f"{self.system}/{self.component}"

    @property
    def foreign(self) -> bool:
        """True if its first bytes were not MAVLink."""
        return self._channel.foreign

    def decode(self, data: bytes) -> Iterator[Any]:
        """Yield the valid messages in received bytes."""
        return self._channel.decode(data)

    def set_source(self, source: tuple[int, int]) -> None:
        """Set system and component id of the vehicle in further messages."""
        self._channel.set_source(source)

    def send(self, *messages: Any) -> None:
        """Send messages, several in a datagram as far as they fit."""
        piece = b""
        for message in messages:
            frame = self._channel.encode(message)
            if len(piece) + len(frame) > MAX_DATAGRAM:
                self._put(piece)
                piece = b""
            piece += frame
        if piece:
            self._put(piece)
