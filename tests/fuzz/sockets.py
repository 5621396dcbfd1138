"""What reads bytes that programs send: the MAVLink link, the page that shows a flight, viewers' WebSocket."""

import atexit
import io
import os
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

from lapwing.messages import Estimate, header
from lapwing.messages.topics import ESTIMATE
from lapwing.runs.live_page import OVER, handler
from lapwing.services import scene_resolver
from lapwing.services.foxglove.server import Server
from lapwing.services.mavlink.adapter import Adapter
from lapwing.services.mavlink.dialect import mavlink
from lapwing.services.mavlink.protocols import handlers
from lapwing.services.mavlink.resolve import describe
from tests.fuzz.mutate import MOST
from tests.fuzz.target import Target
from tests.services.foxglove.client import Client

CONVERSATION = 64  # inputs that one endpoint sends before the next comes
UNANSWERED = 1024  # requests before an answer is awaited, which takes two turns of the processor
STEP = 100_000_000  # [ns] of simulated time from one to the next
_LONGEST_HEAD = 14  # [bytes] of a frame
_SENDER = bytes([255, 190])  # system and component of a ground station


def _conversations() -> Callable[[bytes], None]:
    """Gives bytes to a vehicle, of which estimates come, as those of one endpoint after the other."""
    adapter = Adapter(describe(scene_resolver.load("hover")), lambda command: None)
    now = SimpleNamespace(endpoint=None, count=0)

    def read(data: bytes) -> None:
        if now.count % CONVERSATION == 0:
            if now.endpoint:
                adapter.disconnect(now.endpoint)
            time_ns = now.count // CONVERSATION * STEP
            adapter.take(ESTIMATE, time_ns, Estimate(header(time_ns, "world")).encode(), time_ns * 1e-9)
            now.endpoint = adapter.connect(True, True, lambda sent: None)
        now.count += 1
        adapter.receive(now.endpoint, data)

    return read


def link() -> Target:
    codec = mavlink.MAVLink(None, *_SENDER)
    seeds = [mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3).pack(codec)]
    seeds.append(mavlink.MAVLink_command_long_message(1, 1, 400, 0, 1, 0, 0, 0, 0, 0, 0).pack(codec))
    seeds.append(mavlink.MAVLink_param_set_message(1, 1, b"MIS_TAKEOFF_ALT", 2.5, 9).pack(codec))
    return Target(_conversations(), tuple(seeds))


def frames() -> Target:
    """Frames with a sound checksum of the messages that have a handler, with any payload."""
    numbers, receive = sorted(handlers()), _conversations()

    def read(data: bytes) -> None:
        number, payload = numbers[data[0] % len(numbers) if data else 0], data[1:256]
        body = bytes([len(payload), 0, 0, 0]) + _SENDER + number.to_bytes(3, "little") + payload
        check = mavlink.x25crc(body)
        check.accumulate(bytes([mavlink.mavlink_map[number].crc_extra]))
        receive(b"\xfd" + body + check.crc.to_bytes(2, "little"))

    sizes = [mavlink.mavlink_map[number].unpacker.size for number in numbers]
    return Target(read, tuple(bytes([k]) + bytes(size) for k, size in enumerate(sizes)))


def page() -> Target:
    """Requests to the page of `lapwing run --view`."""
    live: Any = SimpleNamespace(steps=lambda: iter(["data: {}\n\n", OVER]))
    reader = handler("/token/", b"<!doctype html>", live)

    def read(data: bytes) -> None:
        connection = SimpleNamespace(makefile=lambda *_: io.BytesIO(data), sendall=lambda sent: None)
        reader(connection, ("127.0.0.1", 1), SimpleNamespace())  # type: ignore[arg-type]

    host = b"Host: 127.0.0.1:8000\r\nConnection: keep-alive\r\n\r\n"
    return Target(read, (b"GET /token/ HTTP/1.1\r\n" + host, b"GET /token/steps HTTP/1.0\r\n" + host))


def _server() -> Server:
    """One with a topic, to the end of the process."""
    os.environ.setdefault("TOKIO_WORKER_THREADS", "1")  # one client at a time: two thirds of the processor time
    server = Server("127.0.0.1:0").__enter__()
    atexit.register(server.__exit__)
    server.declare("/drone1/estimate", ESTIMATE.message.type_name)
    return server


_TEXTS = (
    b'{"op":"subscribe","subscriptions":[{"id":0,"channelId":1}]}',
    b'{"op":"unsubscribe","subscriptionIds":[0]}',
    b'{"op":"getParameters","parameterNames":["a"],"id":"1"}',
)
_BINARY = b"\1\0\0\0\0"


def _missing(data: bytes) -> int:
    """How many bytes the last of these frames lacks: a server looks at a frame when it is whole."""
    padded, place = data + bytes(_LONGEST_HEAD), 0
    while place < len(data):
        size, mask = padded[place + 1] & 0x7F, 4 if padded[place + 1] & 0x80 else 0
        more = {126: 2, 127: 8}.get(size, 0)
        if more:
            size = int.from_bytes(padded[place + 2 : place + 2 + more], "big")
        place += 2 + more + mask + size
    return place - len(data)


def websocket() -> Target:
    """Frames of a client of `--foxglove`: the server answers what follows, or sends the client away, who comes again.

    The rest of a frame that is too short is sent, too, so that the server reads it, and a connection takes many.
    """
    server = _server()
    now = SimpleNamespace(client=Client(server.port))

    def read(data: bytes) -> None:
        missing = _missing(data)
        if missing > MOST:
            now.client.end(data)
        elif now.client.outlives(data + bytes(missing)):
            return
        now.client.close()
        now.client = Client(server.port)

    frames = [bytes([0x81, 0x80 | len(text), *bytes(4)]) + text for text in _TEXTS]
    return Target(read, (*frames, bytes([0x82, 0x80 | len(_BINARY), *bytes(4)]) + _BINARY))


def requests() -> Target:
    """What such frames hold, in sound ones, so that the server reads all of many: the first byte says which kind."""
    server = _server()
    now = SimpleNamespace(client=Client(server.port), sent=0)

    def read(data: bytes) -> None:
        kind, said = 0x82, data[1:]
        if data[:1] < b"\x80":  # a text that is no UTF-8 ends the connection: `websocket` tries those
            kind, said = 0x81, said.decode(errors="replace").encode()
        now.client.send(bytes([kind, 0xFE]) + len(said).to_bytes(2, "big") + bytes(4) + said)
        now.sent += 1
        if now.sent % UNANSWERED == 0 and not now.client.outlives(b""):
            raise ConnectionError("the server does not answer")

    return Target(read, (*(b"\0" + text for text in _TEXTS), b"\xff" + _BINARY))
