"""Chunk index of a log: equal bytes in memory and in a file, with bounded memory."""

import tracemalloc

import numpy as np
import pytest
from mcap.reader import make_reader

from lapwing.cosim.log import LogWriter, chunk
from lapwing.cosim.log.chunk import ChunkIndexes, Extent
from lapwing.messages import Clock, stamp

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
