"""A blocked publisher reports itself; an unblocked one does not."""

import threading
import time

import pytest

from lapwing.cosim.transport.packet_exchange import WATCH_PERIOD, PublishWatchdog

PATIENCE = 0.5  # [s]


@pytest.fixture
def delivery(request):
    """Return a watchdog and the list of its reports."""
    output = []
    delivery = PublishWatchdog(lambda: output.append(threading.current_thread()), getattr(request, "param", PATIENCE))
    yield delivery, output
    delivery.close()


def test_blocked_publisher_is_reported_repeatedly(delivery):
    watched, output = delivery
    deadline = time.monotonic() + 60.0
    with watched:
        while len(output) < 2 and time.monotonic() < deadline:
            time.sleep(0.1)
    assert len(output) >= 2
    assert threading.current_thread() not in output


@pytest.mark.parametrize("delivery", [60.0], indirect=True)  # [s] for which a busy machine does not stop a thread
def test_fast_publication_is_not_reported(delivery):
    watched, output = delivery
    until = time.monotonic() + 2 * WATCH_PERIOD
    while time.monotonic() < until:
        with watched:
            pass
    assert not output


def test_watchdog_is_silent_without_publications(delivery):
    watched, output = delivery
    with watched:
        pass
    time.sleep(PATIENCE + 2 * WATCH_PERIOD)
    assert not output
