"""The messages of a log do not depend on the arrival of record batches, which are in the file after half a second."""

import random

import numpy as np
import pytest
from mcap.reader import make_reader

from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.diagram.topic_encoder import RecordBatch
from lapwing.cosim.log import LogReader, LogWriter
from lapwing.cosim.log.log_sequencer import CHUNK, SHORTEST, Recording, chunk
from lapwing.messages import Clock, Imu, header
from lapwing.messages.cdr_arrays import Record, stamp_columns
from lapwing.messages.topics import CLOCK, IMU, WALL_TIME

TICKS, TICK = 2500, 4_000_000  # number of ticks, length of a tick [ns]
SETUP = RunConfig("made_up", "", 1, TICKS - 1, 250, TICK, "gauss_seidel", "drone1", {}, {}, {})


def batches(first, stop):
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
            result = [batch for batch in batches(first, stop) if len(batch.ticks)]
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


def test_chunks_of_any_length_have_same_messages(tmp_path, monkeypatch):
    def messages(stops):
        record(tmp_path / "log", stops)
        with LogReader(tmp_path / "log") as log:
            assert log.digest() == log.metadata["digest"]
            return [m for m in log.messages() if m[0] != WALL_TIME.key()]

    whole = messages([1000, 2000, TICKS])
    monkeypatch.setattr("lapwing.cosim.log.log_sequencer.FLUSH_PERIOD", -1.0)
    assert messages([*range(100, TICKS, 130), TICKS]) == whole


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

    recording.write(batches(0, 100), 99)
    assert ticks() == []
    for first, stop in ((100, 200), (200, 300), (300, CHUNK + 60)):
        now[0] += 0.6
        recording.write(batches(first, stop), stop - 1)
        assert ticks() == list(range(stop))
    recording.finish()
    writer.close()
    with open(path, "rb") as file:
        reader = make_reader(file, validate_crcs=True)
        result = [(m.log_time // TICK, m.sequence) for _, c, m in reader.iter_messages() if c.topic == "/drone1/imu"]
        assert result == [(k, k) for k in range(CHUNK + 60)]
        assert reader.get_summary().statistics.chunk_count == 3 + 5  # record batches and wall time
    with LogReader(path) as log:
        assert log.complete
        assert log.digest() == log.metadata["digest"]


def test_chunks_of_many_vehicles_have_fewer_ticks():
    def vehicles(n):
        return SETUP._replace(vehicle="", resolved={"vehicle": [{"vehicle": {"name": f"v{i}"}} for i in range(n)]})

    assert [chunk(SETUP), chunk(vehicles(2)), chunk(vehicles(50))] == [CHUNK, CHUNK // 2, SHORTEST]
