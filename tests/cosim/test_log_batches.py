"""Record batches and single messages produce the same log."""

import itertools
import random

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.records import Chunk, MessageIndex
from mcap.stream_reader import StreamReader, get_chunk_data_stream
from mcap.writer import IndexType, Writer
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader

from lapwing.cosim.log import LogReader, LogWriter
from lapwing.messages import Estimate, Imu, OperatorInput, Vector3, WallTime, header
from lapwing.messages.cdr_arrays import Record, stamp_columns

TICK = 4_000_000  # [ns]


def batch(first, ticks=50):
    """Return the parts of a batch: the IMU at every tick, the estimate at every fifth, of varying size."""
    rng = np.random.default_rng(first)
    ticks = np.arange(first, first + ticks)
    times = ticks * TICK
    columns = {**stamp_columns(times), "linear_acceleration": rng.normal(size=(len(ticks), 3))}
    imu = Record.of(Imu(header(0, "drone1/base_link"))).encode(len(ticks), columns)
    parts = [("/drone1/imu", Imu, times, imu, ticks * 64 + 1)]
    for rest, rejected in ((0, ()), (1, ("gps",)), (2, ("baro", "mag"))):
        some = ticks[(ticks % 5 == 0) & (ticks % 3 == rest)]
        sample = Estimate(header(0, "world"), rejected_sources=rejected)
        columns = {**stamp_columns(some * TICK), "velocity": rng.normal(size=(len(some), 3))}
        parts.append(
            ("/drone1/estimate", Estimate, some * TICK, Record.of(sample).encode(len(some), columns), some * 64)
        )
    return parts


def single(parts):
    """Return the messages of a batch in order: topic, class, payload, time."""
    result = []
    for topic, message, times, payloads, order in parts:
        result += zip(order.tolist(), itertools.repeat((topic, message)), payloads, times.tolist(), strict=False)
    return [(*names, payload.tobytes(), time) for _, names, payload, time in sorted(result, key=lambda item: item[0])]


def write_batches(path, batches):
    with LogWriter(path, {"seed": "7"}, {"scene.toml": b"a = 1\n"}) as log:
        for parts in batches:
            log.write_batch(parts)
    return log.metadata["digest"]


def contents(path):
    """Return topic, type, time, sequence and payload from the mcap library, in file order."""
    with open(path, "rb") as file:
        reader = make_reader(file, validate_crcs=True)
        return [
            (channel.topic, schema.name, message.log_time, message.sequence, message.data)
            for schema, channel, message in reader.iter_messages(log_time_order=False)
        ]


def test_record_batches_equal_single_messages(tmp_path):
    batches = [batch(0), batch(50), batch(100, 7)]
    digest = write_batches(tmp_path / "batches", batches)
    with LogWriter(tmp_path / "single", {}, {}) as log:
        for topic, message, payload, time_ns in itertools.chain(*map(single, batches)):
            log.write(topic, message, payload, time_ns)
    assert log.metadata["digest"] == digest
    assert contents(tmp_path / "batches") == contents(tmp_path / "single")
    with LogReader(tmp_path / "batches") as read, LogReader(tmp_path / "single") as other:
        assert list(read.messages()) == list(other.messages())
        assert read.digest() == digest


def test_record_batch_is_sorted_for_any_block_order(tmp_path):
    parts = batch(0)
    write_batches(tmp_path / "a", [parts])
    random.Random(1).shuffle(parts)
    shuffled = []
    for topic, message, *columns in parts:
        mixed = np.random.default_rng(2).permutation(len(columns[0]))
        shuffled.append((topic, message, *[column[mixed] for column in columns]))
    write_batches(tmp_path / "b", [shuffled])
    assert contents(tmp_path / "a") == contents(tmp_path / "b")


def test_batches_and_messages_keep_call_order(tmp_path):
    path = tmp_path / "mixed"
    values = OperatorInput(header(50 * TICK, "")).encode()
    with LogWriter(path, {}, {}) as log:
        log.write("/drone1/vehicle_command", OperatorInput, values, 0)
        log.write_batch(batch(0))
        log.write("/drone1/vehicle_command", OperatorInput, values, 50 * TICK)
        log.write("/drone1/imu", Imu, Imu().encode(), 50 * TICK)
        log.write_batch(batch(51))
    imu = [entry for entry in contents(path) if entry[0] == "/drone1/imu"]
    assert [(time, sequence) for _, _, time, sequence, _ in imu] == [(k * TICK, k) for k in range(101)]
    at = [k for k, entry in enumerate(contents(path)) if entry[0] == "/drone1/vehicle_command"]
    assert at == [0, 1 + len(single(batch(0)))]


def test_every_page_is_chunk_with_message_index(tmp_path):
    batches = [batch(0), batch(50)]
    write_batches(tmp_path / "log", batches)
    counts, current = [], b""
    with open(tmp_path / "log", "rb") as file:
        for record in StreamReader(file, emit_chunks=True).records:
            if isinstance(record, Chunk):
                stream, size = get_chunk_data_stream(record, validate_crc=True)
                current = stream.read(size)
                counts.append(0)
            elif isinstance(record, MessageIndex):
                counts[-1] += len(record.records)
                for time_ns, offset in record.records:
                    assert current[offset] == 5
                    assert int.from_bytes(current[offset + 9 : offset + 11], "little") == record.channel_id
                    assert int.from_bytes(current[offset + 15 : offset + 23], "little") == time_ns
    assert counts == [len(single(parts)) for parts in batches]


def test_other_tools_find_messages_of_page_by_time(tmp_path):
    write_batches(tmp_path / "log.mcap", [batch(0), batch(50), batch(100)])
    expected = [entry[3] for parts in (batch(0), batch(50)) for entry in single(parts) if entry[0] == "/drone1/imu"][
        40:70
    ]
    with open(tmp_path / "log.mcap", "rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        result = list(reader.iter_decoded_messages(["/drone1/imu"], starting_at=40 * TICK, ending_before=70 * TICK))
        assert [message.log_time for _, _, message, _ in result] == expected
        stamps = [imu.header.stamp.sec * 10**9 + imu.header.stamp.nanosec for *_, imu in result]
        assert stamps == expected
    with AnyReader([tmp_path / "log.mcap"]) as reader:
        required = [connection for connection in reader.connections if connection.topic == "/drone1/imu"]
        result = list(reader.messages(required, start=40 * TICK, stop=70 * TICK))
        assert [time_ns for _, time_ns, _ in result] == expected


def test_file_of_equal_pages_is_independent_of_wall_time(tmp_path, monkeypatch):
    files = []
    for speed in (0.01, 3.0):
        clock = itertools.count(0.0, speed)
        monkeypatch.setattr("lapwing.cosim.log.log_writer.time.monotonic", lambda clock=clock: next(clock))
        write_batches(tmp_path / "log", [batch(50 * k) for k in range(5)])
        files.append((tmp_path / "log").read_bytes())
    assert files[0] == files[1]


def test_wall_time_messages_do_not_change_batch_chunks(tmp_path):
    def chunks(wall_times):
        with LogWriter(tmp_path / "log", {}, {}) as log:
            for k in range(4):
                log.write_batch(batch(50 * k))
                if k in wall_times:
                    message = WallTime(header(0, ""), random.random())
                    log.write("/wall_time", WallTime, message.encode(), 50 * k * TICK, deterministic=False)
        with open(tmp_path / "log", "rb") as file:
            result = StreamReader(file, emit_chunks=True).records
            return [r.data for r in result if isinstance(r, Chunk) and r.message_end_time > r.message_start_time]

    assert chunks([]) == chunks([0, 2]) == chunks([1, 3])


def test_arrays_may_be_reused_after_call(tmp_path):
    batches = [batch(0), batch(50)]
    expected = write_batches(tmp_path / "a", batches)
    with LogWriter(tmp_path / "b", {"seed": "7"}, {"scene.toml": b"a = 1\n"}) as log:
        for parts in batches:
            log.write_batch(parts)
            for _, _, times, payloads, order in parts:
                times[:] = 0
                payloads.view(np.uint8)[:] = 0
                order[:] = 0
    assert log.metadata["digest"] == expected
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()


def test_empty_page_adds_no_chunk(tmp_path):
    write_batches(tmp_path / "log", [[], batch(0, 0)])
    with LogReader(tmp_path / "log") as log:
        assert list(log.messages()) == []
        assert log.complete


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({2: -np.ones(50, np.int64)}, "/drone1/imu: time -1 ns is negative"),
        ({2: np.zeros(49, np.int64)}, r"/drone1/imu: 50 payloads, times \(49,\), order \(50,\)"),
        ({3: np.zeros((50, 8), np.uint8)}, "sensor_msgs/msg/Imu: payload starts with"),
        ({3: np.concatenate([batch(0)[0][3]] * 2)[:50]}, "sensor_msgs/msg/Imu: "),
        ({3: np.zeros((50, 8))}, r"/drone1/imu: payloads are float64 \(50, 8\), expected uint8"),
    ],
)
def test_inconsistent_pages_are_rejected(tmp_path, change, words):
    part = [change.get(k, value) for k, value in enumerate(batch(0)[0])]
    with LogWriter(tmp_path / "log", {}, {}) as log, pytest.raises(ValueError, match=words):
        log.write_batch([tuple(part)])


def test_negative_time_of_single_message_is_rejected(tmp_path):
    with LogWriter(tmp_path / "log", {}, {}) as log, pytest.raises(ValueError, match="/a: time -4 ns is negative"):
        log.write("/a", Imu, Imu().encode(), -4)


def test_full_disk_is_clear_error_for_batches():
    with pytest.raises(ValueError, match="/dev/full: cannot write the log: No space left"):
        write_batches("/dev/full", [batch(0), batch(50)])


def test_history_of_topic(tmp_path):
    batches = [batch(0), batch(50)]
    write_batches(tmp_path / "log", batches)
    with LogReader(tmp_path / "log") as log:
        times, columns = log.history("/drone1/estimate")
        estimates = [entry for parts in batches for entry in single(parts) if entry[1] is Estimate]
        assert times.tolist() == [time_ns for *_, time_ns in estimates]
        decoded = [Estimate.decode(payload) for _, _, payload, _ in estimates]
        assert columns["velocity"].tolist() == [list(message.velocity) for message in decoded]
        assert columns["rejected_sources"] == [message.rejected_sources for message in decoded]
        both = log.histories()
        assert both.keys() == {"/drone1/imu", "/drone1/estimate"}
        assert both["/drone1/imu"][1]["linear_acceleration"].shape == (100, 3)
        with pytest.raises(ValueError, match="has no topic /mag"):
            log.history("/mag")


def test_history_reads_only_chunks_of_its_topic(tmp_path):
    path = tmp_path / "log"
    with LogWriter(path, {}, {}) as log:
        log.write_batch([("/a", Vector3, np.zeros(50, int), Record.of(Vector3()).encode(50, {}), np.zeros(50, int))])
        log.write_batch(batch(0))
    data = bytearray(path.read_bytes())
    at = data.index(b"\x28\xb5\x2f\xfd")  # start of the first compressed chunk
    data[at + 12] ^= 0xFF
    path.write_bytes(data)
    with LogReader(path) as log:
        assert len(log.history("/drone1/imu")[0]) == 50
        with pytest.raises(ValueError, match="damaged chunk"):
            log.history("/a")


def test_log_without_message_indexes_is_read(tmp_path):
    path = tmp_path / "other.mcap"
    with open(path, "wb") as file:
        writer = Writer(file, index_types=IndexType.NONE)
        writer.start()
        schema = writer.register_schema("sensor_msgs/msg/Imu", "ros2msg", Imu.schema_text.encode())
        channel = writer.register_channel("/imu", "cdr", schema)
        for k in range(5):
            writer.add_message(channel, k, Imu(header(k, "a")).encode(), k)
        writer.finish()
    with LogReader(path) as log:
        assert log.history("/imu")[0].tolist() == [0, 1, 2, 3, 4]
