"""Bus: memory, deferred subscriptions, queries, wake-up, settings of the session and its sockets."""

import ast
import os
import re
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from lapwing.cosim.transport.bus import ZenohBus
from lapwing.cosim.transport.session_settings import limit_silence
from tests.endpoints import absent, loopback_endpoints

MESSAGES = 2000
KEY, MARK = "test-bus/_batch/plant", bytes(16)


def anonymous():
    """Return the anonymous memory [bytes] of this process."""
    return 1024 * int(re.search(r"^Anonymous:\s+(\d+)", Path("/proc/self/smaps_rollup").read_text(), re.MULTILINE)[1])


@pytest.mark.skipif(sys.platform != "linux", reason="reads memory from Linux's /proc")
def test_pending_messages_take_little_memory():
    (endpoint,) = loopback_endpoints(["a"]).values()
    with ZenohBus([endpoint]) as there, ZenohBus(connect=[endpoint], gid=MARK) as here:
        arrived, put = there.receive({KEY: MARK}), here.publisher(KEY)
        while arrived.get(timeout=0.1) is None:  # until the subscription has arrived
            put(b"first", 0)

        def send(number):
            """Send `number` messages one by one, as in a run."""
            for _ in range(number):
                put(bytes(300), 0)
                time.sleep(0.0005)
            time.sleep(1.0)

        send(200)
        while arrived.get(timeout=0.0):
            pass
        before = anonymous()
        send(MESSAGES)
        grown = anonymous() - before
        taken = sum(1 for _ in iter(lambda: arrived.get(timeout=0.0), None))
    assert taken == MESSAGES
    assert grown < 2048 * MESSAGES


def test_deferred_subscription_returns_messages_in_order_of_sending():
    other = bytes(15) + b"x"
    (endpoint,) = loopback_endpoints(["a"]).values()
    with ZenohBus([endpoint]) as there, ZenohBus(connect=[endpoint], gid=MARK) as here:
        arrived, put = there.receive({KEY: MARK}, deferred=True), here.publisher(KEY)
        while arrived.get(timeout=0.1) is None:
            put(b"first", 0)
        for number in range(5):
            put(b"%d" % number, number)
        payloads = []
        with ZenohBus(connect=[endpoint], gid=other) as stranger:
            while not (there.rejected and len(payloads) == 5):  # messages are rejected when they are read
                stranger.publisher(KEY)(b"forged", 0)
                payloads += [m[1] for m in iter(lambda: arrived.get(timeout=0.1), None) if m[1] != b"first"]
    assert payloads == [b"%d" % number for number in range(5)]


def test_wake_ends_wait_of_another_thread():
    with ZenohBus() as bus:
        arrived = bus.receive({KEY: MARK}, deferred=True)
        threading.Timer(0.1, arrived.wake).start()
        assert arrived.get_with_key(timeout=600.0) is None


SESSION = """
import os
import sys
from pathlib import Path
from lapwing.cosim.transport.bus import ZenohBus
with ZenohBus([sys.argv[1]]), ZenohBus(connect=[sys.argv[1]]) as bus:
    bus.publisher("a")(b"", 0)
    names = {(task / "comm").read_text().strip() for task in Path("/proc/self/task").iterdir()}
print(sorted(name.partition("-")[0] for name in names if "-" in name))
print(os.environ.get("ZENOH_RUNTIME"))
"""


@pytest.mark.skipif(sys.platform != "linux", reason="reads the names of threads from /proc, which only Linux has")
def test_child_process_does_not_inherit_zenoh_runtime_setting():
    """Another program with a single runtime thread could deadlock in a callback that sends several fragments."""
    (endpoint,) = loopback_endpoints(["a"]).values()
    environment = {key: value for key, value in os.environ.items() if key != "ZENOH_RUNTIME"}
    command = [sys.executable, "-c", SESSION, endpoint]
    output = subprocess.run(command, env=environment, check=True, capture_output=True, text=True, timeout=300).stdout
    kinds, inherited = output.splitlines()
    assert set(ast.literal_eval(kinds)) == {"app"}
    assert inherited == "None"


KEYS = ["test/_alive/responder"]


def test_query_returns_payload_or_none():
    (endpoint,) = loopback_endpoints(["responder"]).values()
    with ZenohBus([endpoint]) as responder, ZenohBus(connect=[endpoint]) as client:
        responder.answer("test/_setup/responder", b"payload")
        responder.declare_liveliness(KEYS[0])
        assert not absent(client, KEYS, 20.0)
        assert client.query("test/_setup/responder", 20.0) == b"payload"
        assert client.query("test/_setup/missing", 20.0) is None


def test_timeout_is_set_on_tcp_sockets_only(tmp_path):
    file = (tmp_path / "a").open("w")
    with socket.create_server(("127.0.0.1", 0)) as door, socket.create_connection(door.getsockname()) as client:
        server, _ = door.accept()
        before = sorted(os.listdir("/proc/self/fd"))
        limit_silence(1234)
        assert sorted(os.listdir("/proc/self/fd")) == before
        for end in (client, server):
            assert end.getsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT) == 1234
        client.sendall(b"x")
        assert server.recv(1) == b"x"
        server.close()
    file.close()
