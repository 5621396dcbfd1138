"""Readers of bytes from other programs: MAVLink link, live page, viewers' WebSocket."""

import atexit
import os
from collections.abc import Callable
from email.message import Message
from types import SimpleNamespace

from lapwing.messages import Estimate, header
from lapwing.messages.topics import ESTIMATE
from lapwing.services import scene_resolver
from lapwing.services.common.mavlink.dialect import mavlink
from lapwing.services.foxglove.server import Server
from lapwing.services.mavlink.adapter import Adapter
from lapwing.services.mavlink.protocols import handlers
from lapwing.services.mavlink.resolve import describe
from lapwing.views.view3d.local_server import Guard
from tests.fuzz.mutate import MOST
from tests.fuzz.target import Target
from tests.services.foxglove.client import Client

CONVERSATION = 64  # inputs per endpoint
UNANSWERED = 1024  # requests between two answers, each of which takes two context switches
STEP = 100_000_000  # [ns] of simulated time between two endpoints
_LONGEST_HEAD = 14  # [bytes] of a frame's head
_SENDER = bytes([255, 190])  # system and component of a ground station


def _conversations() -> Callable[[bytes], None]:
    """Return a function that sends bytes to a vehicle from consecutive endpoints; each starts with an estimate."""
    adapter = Adapter(describe(scene_resolver.load("hover")), lambda command: None)
    state = SimpleNamespace(endpoint=None, count=0)

    def read(data: bytes) -> None:
        if state.count % CONVERSATION == 0:
            if state.endpoint:
                adapter.disconnect(state.endpoint)
            time_ns = state.count // CONVERSATION * STEP
            adapter.handle(ESTIMATE, time_ns, Estimate(header(time_ns, "world")).encode(), time_ns * 1e-9)
            state.endpoint = adapter.connect(True, True, lambda sent: None)
        state.count += 1
        adapter.receive(state.endpoint, data)

    return read


def link() -> Target:
    codec = mavlink.MAVLink(None, *_SENDER)
    seeds = [mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3).pack(codec)]
    seeds.append(mavlink.MAVLink_command_long_message(1, 1, 400, 0, 1, 0, 0, 0, 0, 0, 0).pack(codec))
    seeds.append(mavlink.MAVLink_param_set_message(1, 1, b"MIS_TAKEOFF_ALT", 2.5, 9).pack(codec))
    return Target(_conversations(), tuple(seeds))


def frames() -> Target:
    """Frames with a valid checksum and any payload, for the messages that have a handler."""
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
    """Paths and headers of requests to the guard of the page of `lapwing run --view`."""
    guard = Guard("token", None, lambda query: False)
    guard.hosts = {"127.0.0.1:8000"}
    guard.handler = lambda connection, request: None
    connection = SimpleNamespace(respond=lambda status, text: None)

    def read(data: bytes) -> None:
        first, *lines = data.decode("latin-1").split("\r\n")
        headers = Message()
        for line in lines:
            name, _, value = line.partition(": ")
            headers[name] = value
        words = first.split(" ")
        request = SimpleNamespace(path=words[1] if len(words) > 1 else "", headers=headers)
        guard(connection, request)

    host = b"Host: 127.0.0.1:8000\r\nConnection: keep-alive\r\n\r\n"
    return Target(
        read, (b"GET /token/ HTTP/1.1\r\n" + host, b"GET /token/?a=b HTTP/1.1\r\nUpgrade: websocket\r\n" + host)
    )


def _server() -> Server:
    """Return a server with a topic, which runs until the end of the process."""
    os.environ.setdefault("TOKIO_WORKER_THREADS", "1")  # enough for one client, in two thirds of the processor time
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
    """Return the number of bytes missing from the last frame, since a server handles only complete frames."""
    padded, place = data + bytes(_LONGEST_HEAD), 0
    while place < len(data):
        size, mask = padded[place + 1] & 0x7F, 4 if padded[place + 1] & 0x80 else 0
        more = {126: 2, 127: 8}.get(size, 0)
        if more:
            size = int.from_bytes(padded[place + 2 : place + 2 + more], "big")
        place += 2 + more + mask + size
    return place - len(data)


def websocket() -> Target:
    """Frames of a client of `--foxglove`: the server answers, or closes the connection and accepts another.

    Short frames are padded, so that the server reads them and a connection serves many inputs.
    """
    server = _server()
    state = SimpleNamespace(client=Client(server.port))

    def read(data: bytes) -> None:
        missing = _missing(data)
        if missing > MOST:
            state.client.end(data)
        elif state.client.outlives(data + bytes(missing)):
            return
        state.client.close()
        state.client = Client(server.port)

    frames = [bytes([0x81, 0x80 | len(text), *bytes(4)]) + text for text in _TEXTS]
    return Target(read, (*frames, bytes([0x82, 0x80 | len(_BINARY), *bytes(4)]) + _BINARY))


def requests() -> Target:
    """Payloads in valid frames, so that the server reads all of them; the first byte selects the kind."""
    server = _server()
    state = SimpleNamespace(client=Client(server.port), sent=0)

    def read(data: bytes) -> None:
        kind, output = 0x82, data[1:]
        if data[:1] < b"\x80":  # invalid UTF-8 closes the connection: `websocket` sends such texts
            kind, output = 0x81, output.decode(errors="replace").encode()
        state.client.send(bytes([kind, 0xFE]) + len(output).to_bytes(2, "big") + bytes(4) + output)
        state.sent += 1
        if state.sent % UNANSWERED == 0 and not state.client.outlives(b""):
            raise ConnectionError("the server does not answer")

    return Target(read, (*(b"\0" + text for text in _TEXTS), b"\xff" + _BINARY))
