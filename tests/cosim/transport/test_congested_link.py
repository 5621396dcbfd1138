"""Blocked publishers, and links to a stalled reader, which wait."""

import json
import os
import signal
import subprocess
import sys
import threading
import time

import pytest

from lapwing.cosim.access.private_sockets import private_endpoints
from lapwing.cosim.processes.run_monitor import LONGEST
from lapwing.cosim.transport.bus import ZenohBus
from lapwing.cosim.transport.packet_exchange import WATCH_PERIOD, PublishWatchdog
from lapwing.cosim.transport.session_settings import CHILD_LINKS
from tests.endpoints import absent

MESSAGES, SIZE = 100, 50_000  # much more than the buffers of a link
PAUSE = 2.0  # [s] of the stopped reader, possibly while its link opens
OPEN, LEASE = "transport/unicast/open_timeout", "transport/link/tx/lease"
WAIT = "transport/link/tx/queue/congestion_control/block/wait_before_close"
READER = f"""
import json, sys
from lapwing.cosim.transport.bus import ZenohBus
with ZenohBus(connect=[sys.argv[1]], awaits=False, security=json.loads(sys.argv[2])) as bus:
    messages, count = bus.subscribe("congested/data"), 0
    bus.declare_liveliness("congested/reader")
    while (message := messages.get(120.0)) is not None and message[1]:
        count += len(message[1]) == {SIZE}
    print(count)
"""


def received(settings):
    """Return the number of messages received by a reader that is stopped while they are sent."""
    with private_endpoints(["writer"]) as endpoints, ZenohBus([endpoints["writer"]], security=settings) as bus:
        command = [sys.executable, "-c", READER, endpoints["writer"], json.dumps(settings)]
        reader = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        put = bus.publisher("congested/data")
        assert not absent(bus, ["congested/reader"], 120.0)
        reader.send_signal(signal.SIGSTOP)
        os.waitid(os.P_PID, reader.pid, os.WSTOPPED | os.WNOWAIT)
        resume = subprocess.Popen(["sh", "-c", f"sleep {PAUSE}; kill -CONT {reader.pid}"])
        for i in range(MESSAGES):
            put(bytes(SIZE), i)
        resume.wait()
        while reader.poll() is None:  # its link may reopen
            put(b"", MESSAGES)
            time.sleep(0.1)
        return int(reader.communicate()[0])


@pytest.mark.long
def test_link_of_launcher_waits_for_starved_reader():
    assert received(CHILD_LINKS) == MESSAGES


def test_launcher_detects_stalled_process_before_zenoh_does():
    assert CHILD_LINKS[LEASE] > 1e3 * LONGEST
    assert CHILD_LINKS[OPEN] > 1e3 * LONGEST
    assert CHILD_LINKS[WAIT] > 1e6 * LONGEST


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
