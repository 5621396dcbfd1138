"""Delivery by Zenoh at the end of a session: recent messages may be lost, confirmed messages are not.

`Participant.leave` therefore waits for confirmations.
"""

import multiprocessing
import threading

from lapwing.cosim.access.private_sockets import private_endpoints
from lapwing.cosim.transport.bus import ZenohBus
from tests.endpoints import absent

KEY, CONFIRMED, THERE = "test-close/data", "test-close/confirmed", "test-close/there"
MESSAGES, SIZE = 400, 100_000


def receive(endpoint, results, slow):
    """Count the messages of a sender slowly; confirm the last one by a liveliness token."""
    count, done = 0, threading.Event()

    with ZenohBus(connect=[endpoint], awaits=False) as bus:

        def gone(_, alive):
            if not alive:
                done.set()

        news = bus.subscribe(KEY)
        bus.watch_liveliness("test-close/sender", gone)
        bus.declare_liveliness(THERE)
        while (result := news.get(0.2)) is not None or not done.is_set():
            if result:
                count += 1
                sum(range(slow))  # keeps the interpreter busy, which the session needs
                if result[0] == MESSAGES - 1:
                    bus.declare_liveliness(CONFIRMED)
    results.put(count)


def lost(waits):
    """Return the number of lost messages of a sender that closes at once, or waits for a confirmation."""
    context = multiprocessing.get_context("spawn")
    results = context.Queue()
    confirmed = threading.Event()
    with private_endpoints(["sender"]) as endpoints:
        with ZenohBus(listen=[endpoints["sender"]], awaits=False) as bus:
            receiver = context.Process(target=receive, args=(endpoints["sender"], results, 20_000))
            receiver.start()
            put = bus.publisher(KEY)
            bus.declare_liveliness("test-close/sender")
            bus.watch_liveliness(CONFIRMED, lambda _, alive: alive and confirmed.set())
            assert not absent(bus, [THERE], 60.0)
            for i in range(MESSAGES):
                put(bytes(SIZE), i)
            if waits:
                assert confirmed.wait(120.0)
        count = results.get(timeout=120.0)
        receiver.join()
    return MESSAGES - count


def test_confirmation_covers_all_earlier_messages():
    assert lost(waits=True) == 0
