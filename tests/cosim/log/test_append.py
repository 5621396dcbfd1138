"""Topics added to a log, and the index of its chunks."""

import tracemalloc

import numpy as np
import pytest
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader

from lapwing.cosim.log import LogReader, LogWriter, chunk
from lapwing.cosim.log.chunk import ChunkIndexes, Extent
from lapwing.cosim.log.log_editing import append
from lapwing.cosim.log.mcap_writer import Container
from lapwing.messages import Clock, Log, stamp

EVENTS = [(k, Log(stamp(k), 20, "mode", f"event {k}").encode()) for k in (0, 7, 40, 99)]


@pytest.fixture
def log(tmp_path):
    path = tmp_path / "log.mcap"
    with LogWriter(path, {"seed": "7"}, {"scene.toml": b"x"}) as writer:
        for k in range(100):
            writer.write("/clock", Clock, Clock(stamp(k)).encode(), k)
            if k % 30 == 0:
                writer.flush()
    return path


def test_added_topic_is_in_time_order_in_all_readers(log):
    with LogReader(log) as before:
        digest = before.digest()
    append(log, "/drone1/events", Log, EVENTS)
    expected = sorted(
        [("/clock", k) for k in range(100)] + [("/drone1/events", k) for k, _ in EVENTS], key=lambda m: m[1]
    )
    with LogReader(log) as read:
        assert [(topic, t) for topic, _, t, _ in read.messages()] == expected
        assert [(t, payload) for _, _, t, payload in read.messages(["/drone1/events"])] == EVENTS
        assert read.complete
        assert read.digest() == digest == read.metadata["digest"]
        assert (read.metadata["seed"], read.attachments) == ("7", {"scene.toml": b"x"})
    with open(log, "rb") as file:
        reader = make_reader(file, validate_crcs=True)
        assert [(channel.topic, m.log_time) for _, channel, m in reader.iter_messages()] == expected
        statistics = reader.get_summary().statistics
        assert (statistics.message_count, statistics.message_end_time, statistics.channel_count) == (104, 99, 2)
    with AnyReader([log]) as reader:
        connections = [c for c in reader.connections if c.topic == "/drone1/events"]
        result = [(t, reader.deserialize(raw, c.msgtype).msg) for c, t, raw in reader.messages(connections)]
        assert result == [(k, f"event {k}") for k, _ in EVENTS]


def test_failed_append_leaves_log_unchanged(log, monkeypatch):
    whole, calls = log.read_bytes(), []

    def full(container, data):
        calls.append(data)
        if len(calls) == 2:
            raise OSError(28, "No space left on device")
        container._file.write(data)
        container._offset += len(data)

    monkeypatch.setattr(Container, "_write", full)
    with pytest.raises(ValueError, match="cannot write the log: No space left"):
        append(log, "/drone1/events", Log, EVENTS)
    assert log.read_bytes() == whole


def test_incomplete_log_or_existing_topic_is_rejected(log):
    with pytest.raises(ValueError, match="already has a topic /clock"):
        append(log, "/clock", Clock, [(1, Clock().encode())])
    log.write_bytes(log.read_bytes()[:-20])
    with pytest.raises(ValueError, match="is incomplete, no topic can be added"):
        append(log, "/drone1/events", Log, EVENTS)


TICK = 4_000_000  # [ns]


def batch(first, ticks=4):
    ticks = np.arange(first, first + ticks)
    payloads = [np.frombuffer(Clock(stamp(int(tick) * TICK)).encode(), np.uint8) for tick in ticks]
    return [("/clock", Clock, ticks * TICK, np.array(payloads), ticks)]


def write(path, batches):
    with LogWriter(path, {}, {}) as log:
        for k in range(batches):
            log.write_batch(batch(4 * k))
    return path


def test_index_in_file_equals_index_in_memory(tmp_path, monkeypatch):
    few = write(tmp_path / "few.mcap", 50)
    monkeypatch.setattr(chunk, "IN_MEMORY", 100)
    assert write(tmp_path / "many.mcap", 50).read_bytes() == few.read_bytes()
    assert len(list(tmp_path.iterdir())) == 2
    with few.open("rb") as file:
        summary = make_reader(file).get_summary()
    assert [index.message_start_time for index in summary.chunk_indexes] == [4 * k * TICK for k in range(50)]
    assert summary.statistics.chunk_count == 50
    assert (summary.statistics.message_start_time, summary.statistics.message_end_time) == (0, 199 * TICK)


def test_memory_does_not_grow_with_chunks(tmp_path, monkeypatch):
    monkeypatch.setattr(chunk, "IN_MEMORY", 1000)
    tracemalloc.start()
    try:
        with LogWriter(tmp_path / "log.mcap", {}, {}) as log:
            taken = []
            for k in range(600):
                log.write_batch(batch(4 * k))
                if k % 300 == 299:
                    log.flush()
                    taken.append(tracemalloc.get_traced_memory()[0])
    finally:
        tracemalloc.stop()
    assert taken[1] - taken[0] < 10_000  # [bytes] for 300 chunks


def test_unwritable_index_is_not_counted(tmp_path, monkeypatch):
    monkeypatch.setattr(chunk, "IN_MEMORY", 4)
    indexes = ChunkIndexes(tmp_path / "missing")
    indexes.add(b"abc", 5, 7)
    with pytest.raises(OSError, match="No such file"):
        indexes.add(b"defg", 8, 9)
    assert indexes.extent == Extent(1, 3, 5, 7)
    indexes.extent = Extent()
    indexes.add(b"xy", 3, 4)
    assert indexes.records() == b"xy"
    indexes.close()
