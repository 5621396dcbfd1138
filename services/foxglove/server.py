"""Server for Foxglove and Lichtblick: unchanged payloads with simulation time."""

from typing import Any, Self

from lapwing.messages import TYPES
from lapwing.services.common.address import host_and_port, is_loopback
from lapwing.services.foxglove.origin_gate import OriginGate, hidden_address

BACKLOG = 16384  # [messages] queued for a slow client; the oldest are dropped


def parse_address(text: str) -> tuple[str, int]:
    """Return host and port.

    Raises:
        ValueError: the text does not have the form HOST:PORT.
    """
    result = host_and_port(text)
    if result is None:
        raise ValueError(f"--foxglove {text}: expected HOST:PORT, for example 127.0.0.1:8765")
    return result


def check_address(text: str, insecure: bool) -> None:
    """Check that the address is local, since viewers are not authenticated, or that `insecure` is set.

    Raises:
        ValueError: other machines can reach the address, or it does not have the form HOST:PORT.
    """
    if not is_loopback(parse_address(text)[0]) and not insecure:
        expected = "expected an address of this machine alone, 127.0.0.1:8765, or --insecure"
        raise ValueError(f"--foxglove {text}: any program there could read the run; {expected}")


class Server:
    """WebSocket server of published messages; a context manager."""

    def __init__(self, address: str, insecure: bool = False):
        """Start to listen.

        Args:
            address: HOST:PORT.
            insecure: True if other machines may reach it.

        Raises:
            ValueError: the address is invalid, in use, or reachable from other machines without `insecure`, or
                foxglove-sdk is not installed.
        """
        check_address(address, insecure)
        host, port = parse_address(address)
        try:
            import foxglove
            from foxglove.websocket import Capability
        except ImportError:
            raise ValueError("--foxglove: foxglove-sdk is not installed; pip install lapwing[foxglove]") from None
        foxglove.set_log_level("CRITICAL")  # faulty clients could flood the output with warnings
        self._foxglove: Any = foxglove
        self._context = foxglove.Context()
        self._channels: dict[str, Any] = {}
        self._time_ns = -1
        try:
            self._server = foxglove.start_server(
                name="lapwing",
                host=(hidden := hidden_address()),
                port=0,
                capabilities=[Capability.Time],
                context=self._context,
                message_backlog_size=BACKLOG,
            )
        except Exception as fault:  # the library raises various classes
            raise ValueError(f"--foxglove {address}: cannot listen there: {fault}") from None
        try:
            self._gate = OriginGate(host, port, (hidden, self._server.port))
        except OSError as fault:
            self._server.stop()
            raise ValueError(f"--foxglove {address}: cannot listen there: {fault}") from None
        self.port: int = self._gate.port

    def declare(self, topic: str, type_name: str) -> None:
        """Announce a topic to clients before its first message; unknown types have no channel."""
        if topic in self._channels or type_name not in TYPES:
            return
        text = TYPES[type_name].schema_text.encode()
        schema = self._foxglove.Schema(name=type_name, encoding="ros2msg", data=text)
        channel = self._foxglove.Channel(topic, schema=schema, message_encoding="cdr", context=self._context)
        self._channels[topic] = channel

    def put(self, topic: str, time_ns: int, payload: bytes) -> None:
        """Publish a message of a declared topic."""
        if time_ns != self._time_ns:
            self._time_ns = time_ns
            self._server.broadcast_time(time_ns)
        self.log(topic, time_ns, payload)

    def log(self, topic: str, time_ns: int, payload: bytes) -> None:
        """Publish a delayed message without advancing the simulation time."""
        if topic in self._channels:
            self._channels[topic].log(payload, log_time=time_ns)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._server.stop()
        self._gate.close()
