"""Subscription to one sender and key: order, rejection of others, bounded waiting."""

import time
from itertools import count

import pytest

from lapwing.cosim.transport.bus import INBOX, ZenohBus
from lapwing.cosim.transport.subscription import Inbox
from lapwing.messages.attachment import pack
from tests.endpoints import loopback_endpoints

KEY, MARK, OTHER, WAKER = "test-inbox/_step/plant", bytes(16), b"o" * 16, b"w" * 16


@pytest.fixture
def joined():
    """Yield a bus with an inbox, a publishing bus, and the inbox."""
    (endpoint,) = loopback_endpoints(["a"]).values()
    with ZenohBus([endpoint]) as there, ZenohBus(connect=[endpoint], gid=MARK) as here:
        inbox = there.inbox(KEY, MARK)
        put = here.publisher(KEY)
        while inbox.get(0.1) is None:  # until the subscription has arrived
            put(b"first", 0)
        while inbox.get(0.2):
            pass
        yield there, here, inbox


def test_messages_come_in_order(joined):
    _, here, inbox = joined
    for i in range(200):
        here.publisher(KEY)(b"%d" % i, i)
    assert [inbox.get(5.0) for _ in range(200)] == [(i, b"%d" % i) for i in range(200)]


def test_empty_inbox_waits_for_timeout(joined):
    _, here, inbox = joined
    for timeout in (0.0, 0.1, 0.3):
        started = time.monotonic()
        assert inbox.get(timeout) is None
        assert time.monotonic() - started >= timeout
    here.publisher(KEY)(b"late", 7)
    assert inbox.get(5.0) == (7, b"late")


def test_messages_of_others_are_rejected_and_counted(joined):
    there, here, inbox = joined
    before = there.rejected
    zenoh = here._session
    zenoh.put(KEY, b"")
    zenoh.put(KEY, b"hello", attachment=b"short")
    zenoh.put(KEY, b"forged", attachment=pack(1, 1, OTHER))
    zenoh.delete(KEY)
    here.publisher(KEY)(b"sound", 2)
    assert inbox.get(5.0) == (2, b"sound")
    assert there.rejected - before >= 4


def test_full_ring_drops_oldest_without_blocking(joined):
    _, here, inbox = joined
    put = here.publisher(KEY)
    for i in range(INBOX + 500):
        put(bytes(8), i)
    put(b"last", 0)
    time.sleep(1.0)  # for all to arrive
    arrived = []
    while result := inbox.get(0.2):
        arrived.append(result)
    assert len(arrived) == INBOX
    assert arrived[0] == (501, bytes(8))
    assert arrived[-1] == (0, b"last")


def inbox_of(messages, sender=MARK):
    """Return an inbox whose bus has these messages and then only wakes it, and its counter of rejections."""
    refused = count()
    samples = iter(messages)
    return Inbox(lambda: next(samples, (0, WAKER, b"")), lambda m: m, sender, WAKER, lambda: next(refused)), refused


def test_late_wake_up_is_ignored():
    inbox, _ = inbox_of([(0, WAKER, b""), (0, WAKER, b""), (3, MARK, b"it")])
    assert inbox.get(5.0) == (3, b"it")
    assert inbox.deadline == float("inf")


def test_first_sender_is_accepted_without_known_gid():
    inbox, refused = inbox_of([(1, OTHER, b"one"), (2, MARK, b"two"), None, (3, OTHER, b"three")], sender=None)
    assert [inbox.get(1.0), inbox.get(1.0), inbox.get(0.0)] == [(1, b"one"), (3, b"three"), None]
    assert next(refused) == 2
