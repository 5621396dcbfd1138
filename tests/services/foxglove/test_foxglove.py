"""Foxglove WebSocket server: topics, unchanged payloads, time, access."""

import signal
import socket
import struct
import subprocess
import sys

import pytest

from lapwing.cosim.log import LogReader, LogWriter
from lapwing.messages import Clock, Imu, header, stamp
from lapwing.services.foxglove.server import Server, check_address, parse_address
from tests.endpoints import loopback_endpoints
from tests.services.foxglove.client import Client, patient

pytestmark = pytest.mark.long

pytest.importorskip("foxglove", reason="needs the extra `foxglove`")
TICK = 4_000_000  # [ns]


def test_payloads_are_forwarded_with_simulation_time():
    with Server("127.0.0.1:0") as server:
        server.declare("/drone1/imu", Imu.type_name)
        server.declare("/foreign", "not/ours")
        client = Client(server.port)
        (channel,) = client.subscribe("/drone1/imu")
        assert (channel["encoding"], channel["schemaName"], channel["schemaEncoding"]) == (
            "cdr",
            Imu.type_name,
            "ros2msg",
        )
        assert channel["schema"] == Imu.schema_text
        sent, actual, times, k = [], [], [], 0
        while len(actual) < 5:  # messages before the subscription are lost
            k += 1
            sent.append((k * TICK, Imu(header(k * TICK, "base")).encode()))
            server.put("/drone1/imu", *sent[-1])
            server.put("/foreign", k * TICK, b"")
            message = client.next()
            while message[0] == 2:
                times.append(struct.unpack("<Q", message[1:])[0])
                if times[-1] == k * TICK:
                    break
                message = client.next()
            if message[0] == 1:
                _, subscription, time_ns = struct.unpack_from("<BIQ", message)
                actual.append((time_ns, message[13:]))
                assert subscription == 0
        assert set(actual) <= set(sent)
        assert times == sorted(times)


def test_invalid_frame_closes_connection(capfd):
    with Server("127.0.0.1:0") as server:
        for rubbish in (b"GET", bytes(20), b"\x81\x84" + bytes(4) + b"null", b"\xff" * 10):
            client = Client(server.port)
            client.send(rubbish)
            client.answers()
            client.close()
        assert Client(server.port).outlives(b"")
    assert capfd.readouterr() == ("", "")


def handshake(port, *headers):
    """Return the first line of the answer to a request."""
    lines = ["GET / HTTP/1.1", "Upgrade: websocket", "Connection: Upgrade", "Sec-WebSocket-Version: 13"]
    lines += ["Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==", "Sec-WebSocket-Protocol: foxglove.sdk.v1", *headers]
    with socket.create_connection(("127.0.0.1", port), timeout=30.0) as page:
        page.sendall("\r\n".join([*lines, "", ""]).encode())
        return page.recv(4096).split(b"\r\n")[0].decode()


OWN_HOST = "Host: 127.0.0.1:8765"


@pytest.mark.parametrize(
    "headers",
    [
        (OWN_HOST,),
        ("Host: localhost:8765",),
        ("Host: [::1]:8765",),
        (OWN_HOST, "Origin: https://app.foxglove.dev"),
        (OWN_HOST, "Origin: http://localhost:8080"),
        (OWN_HOST, "Origin: http://127.0.0.1"),
        (OWN_HOST, "Origin: file://"),
    ],
)
def test_viewer_is_accepted(headers):
    with Server("127.0.0.1:0") as server:
        assert " 101 " in handshake(server.port, *headers)


@pytest.mark.parametrize(
    "headers",
    [
        (),
        ("Host: attacker.example:8765",),
        ("Host: localhost.attacker.example",),
        (OWN_HOST, "Host: attacker.example"),
        (OWN_HOST, "Origin: https://attacker.example"),
        (OWN_HOST, "Origin: https://app.foxglove.dev.attacker.example"),
        (OWN_HOST, "Origin: null"),
        (OWN_HOST, "Origin: http://[::1"),
        (OWN_HOST, "Origin: file://", "Origin: https://attacker.example"),
    ],
)
def test_foreign_page_is_rejected(headers):
    with Server("127.0.0.1:0") as server:
        assert " 403 " in handshake(server.port, *headers)
        assert " 101 " in handshake(server.port, OWN_HOST)


@pytest.fixture
def log(tmp_path):
    path = tmp_path / "flight.mcap"
    with LogWriter(path, {}, {}) as writer:
        for tick in range(500):
            writer.write("/clock", Clock, Clock(stamp(tick * TICK)).encode(), tick * TICK)
    return path


def test_replay_is_shown(log):
    (endpoint, door) = loopback_endpoints(["a", "b"]).values()
    port = int(door.rpartition(":")[2])
    command = [sys.executable, "-m", "lapwing", "replay", str(log), "--loop", "--listen", endpoint]
    with subprocess.Popen([*command, "--foxglove", f"127.0.0.1:{port}", "--key-prefix", "test-foxglove"]) as player:
        try:
            client = patient(port, player)
            client.subscribe("/clock")
            message = client.next()
            while not (isinstance(message, bytes) and message[0] == 1):
                message = client.next()
        finally:
            player.terminate()
    time_ns = struct.unpack_from("<Q", message, 5)[0]
    with LogReader(log) as read:
        assert (time_ns, message[13:]) in {(t, payload) for _, _, t, payload in read.messages()}


@pytest.mark.parametrize("text", ["", "8765", "localhost", "localhost:x", "localhost:99999", "a b:1"])
def test_invalid_foxglove_address_is_rejected(text):
    with pytest.raises(ValueError, match="expected HOST:PORT, for example"):
        parse_address(text)


def test_used_address_is_reported():
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
        with pytest.raises(ValueError, match=f"--foxglove 127.0.0.1:{port}: cannot listen there"):
            Server(f"127.0.0.1:{port}")


@pytest.mark.parametrize("text", ["0.0.0.0:1", "[::]:1", "10.0.0.1:1", "robot:1", "127.0.0.1.org:1", "localhost.org:1"])
def test_remote_viewers_need_insecure(text):
    with pytest.raises(ValueError, match=r"any program there could read the run; expected .* or --insecure"):
        Server(text)
    check_address(text, True)


@pytest.mark.parametrize("text", ["127.0.0.1:1", "127.8.0.1:1", "[::1]:1", "localhost:1"])
def test_local_address_is_accepted(text):
    check_address(text, False)


@pytest.mark.parametrize(
    ("scene", "vehicle", "more"), [("hover", "drone1", []), ("fleet", "right", ["--insecure"])], ids=["hover", "fleet"]
)
def test_foxglove_shows_running_flight(tmp_path, scene, vehicle, more):
    (door,) = loopback_endpoints(["a"]).values()
    port = int(door.rpartition(":")[2])
    path = tmp_path / "flight.mcap"
    words = [
        "run",
        scene,
        "--speed",
        "0.2",  # the flight outlasts a starved client's start
        "--set",
        "run.duration=300",
        "--set",
        "success.require=[]",
        "--log",
        str(path),
        "--json",
        str(tmp_path / "a.json"),
        *more,
    ]
    with subprocess.Popen([sys.executable, "-m", "lapwing", *words, "--foxglove", f"127.0.0.1:{port}"]) as run:
        client = patient(port, run)
        assert " 403 " in handshake(port, OWN_HOST, "Origin: https://attacker.example")
        client.subscribe(f"/{vehicle}/ground_truth", f"/{vehicle}/events")
        actual, events, stopped = [], [], False
        while (message := client.next()) is not None:
            if isinstance(message, bytes) and message[0] == 1:
                _, subscription, time_ns = struct.unpack_from("<BIQ", message)
                (events if subscription else actual).append((time_ns, message[13:]))
            if len(actual) > 200 and events and not stopped:
                run.send_signal(signal.SIGINT)  # at any time after the subscription
                stopped = True
        assert run.wait(timeout=300) == (130 if stopped else 0)  # a starved client may miss the end of the flight
    with LogReader(path) as read:
        kept = [(t, payload) for _, _, t, payload in read.messages([f"/{vehicle}/events"])]
        flights = [(t, payload) for _, _, t, payload in read.messages([f"/{vehicle}/ground_truth"])]
    first = flights.index(actual[0])
    both = min(len(actual), len(flights) - first)  # the viewer may see a few messages more than an aborted run records
    assert actual[:both] == flights[first : first + both]  # complete and in order
    assert both > 100
    assert events
    assert set(events) <= set(kept)
    # a viewer that subscribes late receives the earlier events as well; `kept` has later events too
    assert {e for e in kept if e[0] < 100_000_000} <= set(events)
    assert {e for e in kept if e[0] <= actual[-1][0] and b"phase" in e[1]} <= set(events)
