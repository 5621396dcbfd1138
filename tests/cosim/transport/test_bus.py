"""Messages waiting on the bus use the memory of their bytes, not of the receive buffers."""

import re
import sys
import threading
import time
from pathlib import Path

import pytest

from lapwing.cosim.transport.bus import ZenohBus
from tests.endpoints import loopback_endpoints

MESSAGES = 2000
KEY, MARK = "test-bus/_batch/plant", bytes(16)


def anonymous():
    """Memory [bytes] of this process that is of no file."""
    return 1024 * int(re.search(r"^Anonymous:\s+(\d+)", Path("/proc/self/smaps_rollup").read_text(), re.MULTILINE)[1])


@pytest.mark.skipif(sys.platform != "linux", reason="memory is told by Linux's /proc")
def test_messages_that_wait_take_little_memory():
    (endpoint,) = loopback_endpoints(["a"]).values()
    with ZenohBus([endpoint]) as there, ZenohBus(connect=[endpoint], gid=MARK) as here:
        arrived, put = there.receive({KEY: MARK}), here.publisher(KEY)
        while arrived.get(timeout=0.1) is None:  # until the subscription has come
            put(b"first", 0)

        def wait_for(number):
            """So many messages, each on its own, as they come from a run that flies."""
            for _ in range(number):
                put(bytes(300), 0)
                time.sleep(0.0005)
            time.sleep(1.0)

        wait_for(200)
        while arrived.get(timeout=0.0):
            pass
        before = anonymous()
        wait_for(MESSAGES)
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
            while not (there.rejected and len(payloads) == 5):  # a message is rejected when it is taken
                stranger.publisher(KEY)(b"forged", 0)
                payloads += [m[1] for m in iter(lambda: arrived.get(timeout=0.1), None) if m[1] != b"first"]
    assert payloads == [b"%d" % number for number in range(5)]


def test_wake_ends_wait_of_another_thread():
    with ZenohBus() as bus:
        arrived = bus.receive({KEY: MARK}, deferred=True)
        threading.Timer(0.1, arrived.wake).start()
        assert arrived.get_with_key(timeout=600.0) is None
