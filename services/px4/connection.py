"""TCP server of PX4's simulator interface: one firmware at a time, which may come back."""

import contextlib
import select
import socket

from lapwing.services.common.firmware.link import FirmwareError
from lapwing.services.px4.framing import FrameParser, Layout, frame
from lapwing.services.px4.messages import RECEIVED

WAIT = 0.2  # [s] of one wait
PIECE = 65536  # [bytes]
SYSTEM, COMPONENT = 1, 51  # ids of the simulator; PX4 does not check them


class Connection:
    """Server and its connection.

    Attributes:
        connected: False before a firmware has connected, and after it has gone.
        refused: further firmwares that have tried to connect.
    """

    def __init__(self, host: str, port: int):
        """Listen.

        Raises:
            FirmwareError: the port is in use.
        """
        self.where = f"tcp {host}:{port}"
        self._server = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        self._server.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            self._server.bind((host, port))
            self._server.listen(1)
        except OSError as error:
            self._server.close()
            message = f"px4: cannot listen on {self.where} ({error.strerror})"
            raise FirmwareError(f"{message}; end the other simulator, or set autopilot.instance") from None
        self._peer: socket.socket | None = None
        self._parser, self._sequence = FrameParser(RECEIVED), 0
        self.refused = self._rejected = 0

    @property
    def connected(self) -> bool:
        """Return True while a firmware is connected."""
        return self._peer is not None

    @property
    def rejected(self) -> int:
        """Count of malformed pieces of the streams."""
        return self._rejected + self._parser.rejected

    def accept(self, wait: float = WAIT) -> bool:
        """Wait for a firmware at most `wait` [s]. Return True once one is connected."""
        self._server.settimeout(wait)
        try:
            self._peer, _ = self._server.accept()
        except OSError:
            return False
        self._peer.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._peer.setblocking(False)
        self._poll = select.poll()
        self._poll.register(self._peer, select.POLLIN)
        return True

    def refuse_others(self) -> None:
        """Close the connection of a second firmware, unless the first one has gone."""
        if self._peer is None or self._gone(self._peer):
            return
        self._server.settimeout(0.0)
        with contextlib.suppress(OSError):
            other, _ = self._server.accept()
            other.close()
            self.refused += 1

    def send(self, messages: list[tuple[Layout, tuple]]) -> None:
        """Send messages in one piece; they are lost if the firmware has gone."""
        if self._peer is None:
            return
        data = b""
        for layout, values in messages:
            data += frame(layout, self._sequence, values, SYSTEM, COMPONENT)
            self._sequence = (self._sequence + 1) & 0xFF
        try:
            self._peer.sendall(data)
        except OSError:  # also a full buffer: a firmware that has not read for a long time
            self._lose()

    def receive(self, wait: bool = True) -> list[tuple[int, tuple]]:
        """Return the messages that have come; wait for some at most 0.2 s if `wait`."""
        if self._peer is None:
            return []
        if wait and not self._poll.poll(1000.0 * WAIT):
            return []
        try:
            data = self._peer.recv(PIECE)
        except BlockingIOError:
            return []
        except OSError:
            data = b""
        if not data:
            self._lose()
            return []
        return self._parser.parse(data)

    @staticmethod
    def _gone(peer: socket.socket) -> bool:
        """Return True if the other end has closed the connection."""
        try:
            return not peer.recv(1, socket.MSG_PEEK)
        except BlockingIOError:
            return False
        except OSError:
            return True

    def close(self) -> None:
        """Close the connection and the server."""
        self._lose()
        self._server.close()

    def _lose(self) -> None:
        if self._peer is not None:
            self._peer.close()
            self._peer = None
        self._rejected += self._parser.rejected
        self._parser = FrameParser(RECEIVED)
