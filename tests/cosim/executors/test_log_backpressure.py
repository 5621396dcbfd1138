"""A run waits while it is too far ahead of its log, and reports that it waits for the log."""

import struct
import threading
from types import SimpleNamespace

import pytest

from lapwing.cosim.access.publisher_ids import PublisherIds
from lapwing.cosim.executors import log_backpressure
from lapwing.cosim.executors.log_backpressure import (
    AHEAD,
    LEAST,
    LOOK,
    LogBackpressure,
    LogProgressPublisher,
    waits_for_disk,
)
from lapwing.cosim.log import LogWriter
from lapwing.cosim.log.log_sequencer import SHORTEST
from lapwing.cosim.transport.packet_exchange import PACKET_TICKS
from lapwing.messages import Clock, stamp


class Bus:
    """Bus that returns its own messages."""

    def __init__(self):
        self.sent = []

    def publisher(self, key):
        return lambda payload, time_ns: self.sent.append(payload)

    def receive(self, senders):
        return self

    def get(self, timeout):
        return (0, self.sent.pop(0)) if self.sent else None


class Process:
    """Participant whose log advances by 3000 ticks during each wait."""

    participants = PublisherIds("test")

    def __init__(self, vehicles=1):
        self.bus, self.waits = Bus(), []
        self.config = SimpleNamespace(vehicles=["drone"] * vehicles)

    def wait_with_status(self, get, waiting_for):
        self.waits.append(waiting_for())
        return 0, struct.pack("<q?", 3000 * len(self.waits), True)


def test_run_waits_while_log_is_behind():
    process = Process()
    pressure, progress = LogBackpressure(process, "recorder"), LogProgressPublisher(process.bus, "test", "recorder")
    for tick in range(0, 10 * AHEAD, LOOK):  # without a recorder
        pressure.wait_for_log(tick)
    assert process.waits == []
    progress.recorded(0)
    pressure.wait_for_log(AHEAD - LOOK)
    assert process.waits == []
    pressure.wait_for_log(AHEAD)
    assert process.waits == ["the log, recorded up to tick 0"]
    pressure.wait_for_log(AHEAD + 6144)
    assert process.waits[1:] == ["the log, recorded up to tick 3000", "the log, recorded up to tick 6000"]


@pytest.mark.parametrize(("vehicles", "ahead"), [(1, AHEAD), (2, AHEAD // 2), (50, LEAST)])
def test_allowed_lead_over_log_shrinks_with_vehicles(vehicles, ahead):
    process = Process(vehicles)
    pressure, progress = LogBackpressure(process, "recorder"), LogProgressPublisher(process.bus, "test", "recorder")
    progress.recorded(0)
    pressure.wait_for_log(ahead - LOOK)
    assert process.waits == []
    pressure.wait_for_log(ahead)
    assert process.waits


def test_allowed_lead_covers_unrecorded_ticks():
    assert LEAST >= PACKET_TICKS + LOOK + SHORTEST  # an unsent log packet and an incomplete chunk


def test_progress_reports_waiting_for_disk():
    bus = Bus()
    progress = LogProgressPublisher(bus, "test", "recorder")
    progress.recorded(7)
    progress.waiting()
    assert [waits_for_disk(payload) for payload in bus.sent] == [False, True]
    assert log_backpressure._PROGRESS.unpack(bus.sent[1])[0] == 7


def test_slow_disk_is_reported_and_one_chunk_is_buffered(tmp_path, monkeypatch):
    monkeypatch.setattr("lapwing.cosim.log.log_writer.FLUSH_PERIOD", 0.01)
    go_on, reported = threading.Event(), threading.Event()
    with LogWriter(tmp_path / "log", {}, {}, reported.set) as writer:
        write = writer._container.add_chunk
        monkeypatch.setattr(writer._container, "add_chunk", lambda *values: (go_on.wait(), write(*values)))

        def say(time_ns):
            writer.write("/clock", Clock, Clock(stamp(time_ns)).encode(), time_ns)
            writer._cut()

        say(0)
        waiting = threading.Thread(target=say, args=(1,))
        waiting.start()
        assert reported.wait(30.0)
        assert waiting.is_alive()  # the second chunk waits for the first
        go_on.set()
        waiting.join(30.0)
        assert writer.waited > 0.0
