"""Who stands still since a message finds no room says so; who publishes at leisure says nothing."""

import threading
import time

import pytest

from lapwing.cosim.transport.publish_watchdog import LOOK, PublishWatchdog

PATIENCE = 0.5  # [s]


@pytest.fixture
def delivery(request):
    """One that watches, and what it has said."""
    said = []
    delivery = PublishWatchdog(lambda: said.append(threading.current_thread()), getattr(request, "param", PATIENCE))
    yield delivery, said
    delivery.close()


def test_a_message_without_room_is_told_again_and_again_from_another_thread(delivery):
    watched, said = delivery
    deadline = time.monotonic() + 60.0
    with watched:
        while len(said) < 2 and time.monotonic() < deadline:
            time.sleep(0.1)
    assert len(said) >= 2
    assert threading.current_thread() not in said


@pytest.mark.parametrize("delivery", [60.0], indirect=True)  # [s] for which a busy machine does not stop a thread
def test_what_takes_no_time_is_not_told(delivery):
    watched, said = delivery
    until = time.monotonic() + 2 * LOOK
    while time.monotonic() < until:
        with watched:
            pass
    assert not said


def test_nothing_is_told_while_nothing_is_published(delivery):
    watched, said = delivery
    with watched:
        pass
    time.sleep(PATIENCE + 2 * LOOK)
    assert not said
