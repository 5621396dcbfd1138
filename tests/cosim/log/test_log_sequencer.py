"""A log file does not depend on the arrival of record batches, which are in the file after half a second."""

import io
import random

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.records import Chunk
from mcap.stream_reader import StreamReader

from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.diagram.topic_encoder import RecordBatch
from lapwing.cosim.log import LogReader, LogWriter
from lapwing.cosim.log.log_sequencer import CHUNK, SHORTEST, Recording, chunk
from lapwing.messages import Clock, Imu, header
from lapwing.messages.cdr_arrays import Record, stamp_columns
from lapwing.messages.topics import CLOCK, IMU

TICKS, TICK = 2500, 4_000_000  # number of ticks, length of a tick [ns]
SETUP = RunConfig("made_up", "", 1, TICKS - 1, 250, TICK, "gauss_seidel", "drone1", {}, {}, {})


def pages(first, stop):
    ticks = np.arange(first, stop)
    times = ticks * TICK
    acceleration = np.random.default_rng(1).normal(size=(TICKS, 3))[first:stop]
    imu = {**stamp_columns(times), "linear_acceleration": acceleration}
    yield RecordBatch(IMU, ticks, Record.of(Imu(header(0, "base"))).encode(len(ticks), imu))
    some = ticks[ticks % 5 == 0]
    yield RecordBatch(CLOCK, some, Record.of(Clock()).encode(len(some), stamp_columns(some * TICK, "clock")))


def record(path, stops, shuffle=False):
    with LogWriter(path, {"seed": "1"}, {"scene.toml": b"a = 1\n"}) as writer:
        recording = Recording(writer, SETUP)
        for first, stop in zip([0, *stops], stops, strict=False):
            result = [page for page in pages(first, stop) if len(page.ticks)]
            recording.write(reversed(result) if shuffle else result, stop - 1)
        recording.finish()
    return path.read_bytes()


@pytest.fixture
def stopped_clock(monkeypatch):
    monkeypatch.setattr("lapwing.cosim.log.log_sequencer.time.time", lambda: 1.7e9)
    monkeypatch.setattr("lapwing.cosim.log.log_sequencer.time.monotonic", lambda: 5.0)


@pytest.mark.usefixtures("stopped_clock")
def test_file_is_independent_of_arrival_of_batches(tmp_path):
    whole = record(tmp_path / "a", [1000, 2000, TICKS])
    rng = random.Random(1)
    for k in range(3):
        stops = [*sorted(rng.sample(range(1, TICKS), 20 * k + 1)), TICKS]
        assert record(tmp_path / "b", stops, shuffle=bool(k % 2)) == whole


def test_provisional_chunks_change_wall_time_only(tmp_path, monkeypatch):
    """Compare files with and without provisional chunks."""
    one = record(tmp_path / "a", [1000, 2000, TICKS])
    monkeypatch.setattr("lapwing.cosim.log.log_sequencer.FLUSH_PERIOD", -1.0)
    other = record(tmp_path / "b", [*range(100, TICKS, 100), TICKS])
    assert len(one) == len(other)
    chunks = [
        [r for r in StreamReader(io.BytesIO(p), emit_chunks=True).records if isinstance(r, Chunk)] for p in (one, other)
    ]
    for a, b in zip(*chunks, strict=True):
        assert a.data == b.data or a.compression == b.compression == ""
    wall = [
        (one.index(c.data) - 29, one.index(c.data) + len(c.data)) for c in chunks[0] if not c.compression
    ]  # including the checksum
    differing = np.flatnonzero(np.frombuffer(one, np.uint8) != np.frombuffer(other, np.uint8))
    assert all(any(first <= place < stop for first, stop in wall) for place in differing.tolist())


def test_incomplete_chunk_is_in_file(tmp_path, monkeypatch):
    now = [0.0]
    monkeypatch.setattr("lapwing.cosim.log.log_sequencer.time.monotonic", lambda: now[0])
    path = tmp_path / "log"
    writer = LogWriter(path, {}, {})
    recording = Recording(writer, SETUP)

    def ticks():
        writer.flush()
        with LogReader(path) as log:
            return [t // TICK for topic, _, t, _ in log.messages() if topic == "/drone1/imu"]

    recording.write(pages(0, 100), 99)
    assert ticks() == []
    for first, stop in ((100, 200), (200, 300), (300, CHUNK + 50), (CHUNK + 50, CHUNK + 60)):
        now[0] += 0.6
        recording.write(pages(first, stop), stop - 1)
        assert ticks() == list(range(CHUNK if first == 300 else stop))  # messages after a complete chunk wait
    recording.finish()
    writer.close()
    with open(path, "rb") as file:
        reader = make_reader(file, validate_crcs=True)
        result = [(m.log_time // TICK, m.sequence) for _, c, m in reader.iter_messages() if c.topic == "/drone1/imu"]
        assert result == [(k, k) for k in range(CHUNK + 60)]
        assert reader.get_summary().statistics.chunk_count == 2 + 3  # record batches and wall time
    with LogReader(path) as log:
        assert log.complete
        assert log.digest() == log.metadata["digest"]


def test_slow_provisional_chunk_is_written_rarely(tmp_path, monkeypatch):
    """Otherwise a late recorder would write the same chunk repeatedly and never catch up."""
    now, tails = [0.0], []
    monkeypatch.setattr("lapwing.cosim.log.log_sequencer.time.monotonic", lambda: now[0])

    def slow(self, parts):
        tails.append(round(now[0], 1))
        now[0] += 1.0

    monkeypatch.setattr(LogWriter, "write_tail", slow)
    with LogWriter(tmp_path / "log", {}, {}) as writer:
        recording = Recording(writer, SETUP)
        for k in range(30):
            now[0] += 0.5
            recording.write(pages(10 * k, 10 * k + 10), 10 * k + 9)
        recording.finish()
    assert tails == [0.5, 11.5]


def test_chunks_of_many_vehicles_have_fewer_ticks():
    def vehicles(n):
        return SETUP._replace(vehicle="", resolved={"vehicle": [{"vehicle": {"name": f"v{i}"}} for i in range(n)]})

    assert [chunk(SETUP), chunk(vehicles(2)), chunk(vehicles(50))] == [CHUNK, CHUNK // 2, SHORTEST]
