"""TCP server of PX4's simulator interface: one firmware at a time, which may reconnect."""

import socket

from lapwing.services.common.firmware.link import FirmwareError
from lapwing.services.common.firmware.mavlink_transport import UdpTransport
from lapwing.services.common.firmware.setup import FirmwareSetup
from lapwing.services.px4.framing import FrameParser, Layout, frame
from lapwing.services.px4.messages import RECEIVED
from lapwing.services.px4.sensor_frame import COMPONENT, SYSTEM, Sensors, sensor_frame
from lapwing.services.px4.stream import CLOSED, PIECE, SEND_FLAGS, WAIT, Stream, connect

PORT, MAVLINK_PORT = 4560, 14540


class Connection:
    """Server and its connection.

    Attributes:
        memory: memory of the connection, shared with compiled code.
        connected: True while a firmware is connected.
        extra_connections: connections of further firmwares, which were closed.
    """

    def __init__(self, host: str, port: int, memory: Stream):
        """Listen on the port.

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
            raise FirmwareError(f"{message}; stop the other simulator, or set autopilot.instance") from None
        self._peer: socket.socket | None = None
        self._parser, self.memory = FrameParser(RECEIVED), memory
        self.extra_connections = self._rejected = 0

    @property
    def connected(self) -> bool:
        """True while a firmware is connected."""
        return self._peer is not None

    @property
    def rejected(self) -> int:
        """Number of malformed parts of the streams."""
        return self._rejected + self._parser.rejected

    def accept(self, wait: float = WAIT) -> bool:
        """Wait for a firmware at most `wait` [s]. Return True once one is connected."""
        self._server.settimeout(wait)
        try:
            self._peer, _ = self._server.accept()
        except OSError:
            return False
        self._peer.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        connect(self.memory, self._peer)
        return True

    def reject_others(self) -> bool:
        """Close a connection of a second firmware while the first is connected. Return True if there was one."""
        if self._peer is None or self._is_closed(self._peer):
            return False
        self._server.settimeout(0.0)
        try:
            self._server.accept()[0].close()
        except OSError:
            return False
        self.extra_connections += 1
        return True

    def send_sensors(self, time_us: int, sensors: Sensors) -> None:
        """Send HIL_SENSOR; it is lost if the firmware has disconnected."""
        if self._peer is None:
            return
        try:
            self._peer.sendall(sensor_frame(self._next_sequence(), time_us, sensors), SEND_FLAGS)
        except OSError:  # also if the buffer is full, since the firmware does not read
            self.lose()

    def append(self, messages: list[tuple[Layout, tuple]]) -> None:
        """Append messages to those that compiled code sends."""
        for layout, values in messages:
            data = frame(layout, self._next_sequence(), values, SYSTEM, COMPONENT)
            begin = int(self.memory.sent_size[0])
            self.memory.sent[begin : begin + len(data)] = bytearray(data)
            self.memory.sent_size[0] = begin + len(data)

    def receive(self, wait: bool = True) -> list[tuple[int, tuple]]:
        """Return the received messages; if `wait`, wait for them at most 0.2 s."""
        if self._peer is None:
            return []
        try:
            data = self._peer.recv(PIECE, 0 if wait else socket.MSG_DONTWAIT)
        except BlockingIOError:
            return []
        except OSError:
            data = b""
        return self._parse(data)

    def parse_received(self, size: int) -> list[tuple[int, tuple]]:
        """Return the messages in the `size` bytes that compiled code has received; see `stream.receive`."""
        if size < CLOSED or self._peer is None:
            return []
        return self._parse(self.memory.received[:size].tobytes())

    def _parse(self, data: bytes) -> list[tuple[int, tuple]]:
        if not data:
            self.lose()
            return []
        result = self._parser.parse(data)
        self.memory.rest[0] = self._parser.rest
        return result

    def _next_sequence(self) -> int:
        sequence = int(self.memory.sequence[0])
        self.memory.sequence[0] = (sequence + 1) & 0xFF
        return sequence

    @staticmethod
    def _is_closed(peer: socket.socket) -> bool:
        """Return True if the other end has closed the connection."""
        try:
            return not peer.recv(1, socket.MSG_PEEK | socket.MSG_DONTWAIT)
        except BlockingIOError:
            return False
        except OSError:
            return True

    def close(self) -> None:
        """Close the connection and the server."""
        self.lose()
        self._server.close()

    def lose(self) -> None:
        """Close the connection."""
        connect(self.memory, None)
        if self._peer is not None:
            self._peer.close()
            self._peer = None
        self._rejected += self._parser.rejected
        self._parser = FrameParser(RECEIVED)


def claim(setup: FirmwareSetup, memory: Stream) -> tuple[Connection, UdpTransport]:
    """Open the ports of an instance.

    Raises:
        FirmwareError: a port is in use.
    """
    connection, port = Connection(setup.host, setup.port_at(PORT), memory), MAVLINK_PORT + setup.instance
    try:
        return connection, UdpTransport(setup.host, port)
    except OSError as error:
        connection.close()
        message = f"px4: cannot listen on udp {setup.host}:{port} ({error.strerror})"
        raise FirmwareError(f"{message}; stop the other program, or set autopilot.instance") from None
