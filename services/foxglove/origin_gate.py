"""Gate before the WebSocket server, which rejects connections of foreign web pages.

A browser lets any page open a WebSocket to this machine; the header Origin has the page's name. If this name was
rebound to a local address (DNS rebinding), it is in Host. foxglove-sdk checks neither. The SDK's server therefore
listens at a random address of 127.0.0.0/8, which a page cannot find, and this gate at the public address.
"""

import asyncio
import ipaddress
import secrets
import socket
import threading
from collections.abc import Iterable
from contextlib import suppress
from urllib.parse import urlsplit

from lapwing.services.common.address import is_loopback

LONGEST_HEAD = 8192  # [bytes] limit of a request's head
HEAD_TIMEOUT = 10.0  # [s] for the head to arrive
END_TIMEOUT = 2.0  # [s] for clients to read the remaining data
CHUNK = 65536  # [bytes]
HOSTED = ("https://app.foxglove.dev", "https://studio.foxglove.dev")  # web pages of viewers
DESKTOP = "file://"  # pages of an installed viewer
_END = b"\r\n\r\n"


def hidden_address() -> str:
    """Return a random loopback address."""
    return str(ipaddress.IPv4Address(0x7F000002 + secrets.randbelow(2**24 - 4)))


def rejection_reason(head: bytes, host: str) -> str | None:
    """Return the reason to reject a request; None: accept it.

    Args:
        head: request line and headers.
        host: host on which the server listens.
    """
    result: dict[str, list[str]] = {}
    for line in head.decode("latin-1").split("\r\n")[1:]:
        name, _, value = line.partition(":")
        result.setdefault(name.strip().lower(), []).append(value.strip())
    hosts, origins = result.get("host", []), result.get("origin", [])
    if len(hosts) != 1 or not _is_own(_name(f"//{hosts[0]}"), host):
        return f"Host {', '.join(hosts) or 'missing'}: expected an address of this machine"
    if origins and not all(_is_viewer(origin, host) for origin in origins):
        return f"Origin {', '.join(origins)}: is not a viewer; expected {' or '.join(HOSTED)} or a page of this machine"
    return None


def _is_viewer(origin: str, host: str) -> bool:
    name = _name(origin)
    return origin in (*HOSTED, DESKTOP) or (bool(name) and (is_loopback(name) or name == host))


def _is_own(name: str, host: str) -> bool:
    """Return True for an IP address, localhost and the listening host; a foreign page has another name."""
    with suppress(ValueError):
        return bool(ipaddress.ip_address(name))
    return name in ("localhost", host) and bool(name)


def _name(url: str) -> str:
    try:
        return urlsplit(url).hostname or ""
    except ValueError:
        return ""


class OriginGate:
    """Thread that forwards the connections of viewers.

    Attributes:
        port: port at which it listens.
        rejected: number of rejected connections.
    """

    def __init__(self, host: str, port: int, server: tuple[str, int]):
        """Start to listen.

        Args:
            host, port: public address.
            server: address of the WebSocket server.

        Raises:
            OSError: the gate cannot listen at the address.
        """
        self._host, self._server, self.rejected = host, server, 0
        family = socket.AF_INET6 if ":" in host else socket.AF_INET
        self._socket = socket.create_server((host, port), family=family)
        self.port: int = self._socket.getsockname()[1]
        self._loop = asyncio.new_event_loop()
        self._open: set[asyncio.Task[None]] = set()
        self._listening = threading.Event()
        self._thread = threading.Thread(target=self._loop.run_until_complete, args=(self._serve(),), daemon=True)
        self._thread.start()
        self._listening.wait()

    async def _serve(self) -> None:
        self._stop = asyncio.Event()
        server = await asyncio.start_server(self._accept, sock=self._socket, limit=LONGEST_HEAD)
        self._listening.set()
        await self._stop.wait()
        server.close()
        if self._open:
            _, unfinished = await asyncio.wait(self._open, timeout=END_TIMEOUT)
            await _cancel(unfinished)

    async def _accept(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        task = asyncio.current_task()
        assert task is not None
        self._open.add(task)
        try:
            with suppress(OSError, TimeoutError, asyncio.IncompleteReadError, asyncio.LimitOverrunError):
                head = await asyncio.wait_for(reader.readuntil(_END), HEAD_TIMEOUT)
                if reason := rejection_reason(head, self._host):
                    self.rejected += 1
                    text = reason.encode("ascii", "replace")
                    status = b"HTTP/1.1 403 Forbidden\r\nConnection: close\r\nContent-Type: text/plain\r\n"
                    writer.write(status + b"Content-Length: %d\r\n\r\n%b" % (len(text), text))
                    await writer.drain()
                else:
                    await self._forward(head, reader, writer)
        finally:
            writer.close()
            self._open.discard(task)

    async def _forward(self, head: bytes, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        server_reader, server_writer = await asyncio.open_connection(*self._server)
        server_writer.write(head)
        to_server = asyncio.create_task(_pump(reader, server_writer))
        try:
            await _pump(server_reader, writer)
        finally:
            await _cancel([to_server])
            server_writer.close()

    def close(self) -> None:
        """Let clients read the remaining data, and stop. Stop the server first."""
        self._loop.call_soon_threadsafe(self._stop.set)
        self._thread.join()
        self._loop.close()


async def _pump(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    """Copy until the end of `reader`, and end `writer`."""
    with suppress(OSError):
        while data := await reader.read(CHUNK):
            writer.write(data)
            await writer.drain()
        if writer.can_write_eof():
            writer.write_eof()


async def _cancel(tasks: Iterable["asyncio.Task[None]"]) -> None:
    for task in tasks:
        task.cancel()
        with suppress(asyncio.CancelledError):
            await task
