"""A run on a busy machine: monitor, garbage collection, orphans."""

import subprocess
import sys
from collections import deque
from types import SimpleNamespace

import pytest

from lapwing.cosim.access.publisher_ids import PublisherIds
from lapwing.cosim.processes.run_monitor import RunMonitor
from lapwing.cosim.transport.bus_keys import BATCH_KEY, HEARD_KEY, RECORDED_KEY

SERVICES = ["plant", "sensors"]


class Bus:
    """Bus of pending messages, on a machine on which each reading of the clock takes a second."""

    def __init__(self, monkeypatch):
        self.now, self.messages, self.tokens = 0.0, deque(), []
        monkeypatch.setattr("lapwing.cosim.processes.run_monitor.time.monotonic", self.clock)

    def clock(self):
        self.now += 1.0
        return self.now

    def receive(self, senders):
        return self

    def watch_liveliness(self, key, on_change):
        pass

    def declare_liveliness(self, key):
        self.tokens.append(key)

    @property
    def pending(self):
        return len(self.messages)

    def get_with_key(self, timeout):
        return self.messages.popleft() if self.messages else None


def test_poll_reads_all_pending_messages_after_its_time(monkeypatch):
    bus = Bus(monkeypatch)
    monitor = RunMonitor(bus, PublisherIds("run"), SERVICES, services=SERVICES)
    progress = (f"run/{RECORDED_KEY}/recorder", 0, bytes(9))
    bus.messages.extend([progress] * 500)
    bus.messages.extend((f"run/{BATCH_KEY}/{name}", 0, b"") for name in SERVICES)
    monitor.poll(0.05)
    assert monitor.complete
    assert bus.tokens == [f"run/{HEARD_KEY}/mission"]


def test_repeated_last_message_of_recorder_is_no_news(monkeypatch):
    bus = Bus(monkeypatch)
    monitor = RunMonitor(bus, PublisherIds("run"), SERVICES, services=SERVICES)
    bus.messages.append(last := (f"run/{RECORDED_KEY}/recorder", 0, b""))
    monitor.poll(0.05)
    news = monitor.last_news
    bus.messages.append(last)
    monitor.poll(0.05)
    assert monitor.last_news == news


def test_confirmation_is_news(monkeypatch):
    bus = SimpleNamespace(
        receive=lambda senders: None, watch_liveliness=lambda key, on_change: watched.append(on_change)
    )
    watched = []
    monitor = RunMonitor(bus, PublisherIds("run"), SERVICES, services=SERVICES)
    monitor.last_news = -1.0
    watched[-1](f"run/{HEARD_KEY}/recorder", True)
    assert monitor.confirmed == {"recorder"}
    assert monitor.last_news > 0.0


END = """
import atexit
from lapwing.cosim.processes import relax_gc

class Ring:
    def __init__(self):
        self.itself = self
    def __del__(self):
        print("collected")

{call}
atexit.register(print, "at exit")
ring = Ring()
"""


@pytest.mark.parametrize(("call", "output"), [("", ["at exit", "collected"]), ("relax_gc()", ["at exit"])])
def test_relaxed_process_skips_collection_at_exit(call, output):
    ended = subprocess.run([sys.executable, "-c", END.format(call=call)], capture_output=True, text=True, check=True)
    assert ended.stdout.splitlines() == output


BUSY = """
import sys, time
from types import SimpleNamespace
from lapwing.cosim.executors import stop_request as process
process.ORPHANED = 0.1
process.StopRequest.stop_with_parent(SimpleNamespace(), sys.argv[1])
print("busy", flush=True)
time.sleep(600.0)
"""


def test_busy_orphan_process_exits(tmp_path):
    folder = tmp_path / "sockets"
    folder.mkdir()
    command = [sys.executable, "-c", BUSY, f"unixsock-stream/{folder}/plant"]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as busy:
        assert busy.stdout.readline() == b"busy\n"
        assert busy.poll() is None
        busy.stdin.close()
        assert busy.wait(60.0) == 1
    assert not folder.exists()
