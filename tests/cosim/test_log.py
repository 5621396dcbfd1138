import random
import signal
import subprocess
import sys
import textwrap

import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader

from lapwing.cosim.log import LogReader, LogWriter
from lapwing.messages import Clock, Imu, Status, TFMessage, TransformStamped, WallTime, header, stamp
from lapwing.messages.digest import Digest


def messages(count=300):
    """Return (topic, message, time) of three topics, some at equal times, one of them late."""
    rng = random.Random(1)
    result = []
    for k in range(count):
        t = k * 4_000_000
        result.append(("/clock", Clock(stamp(t)), t))
        imu = Imu(header(t, "drone1/base_link"))
        result.append(("/drone1/imu", imu._replace(linear_acceleration=(rng.random(), 0.0, 9.81)), t))
        if k % 5 == 4:
            tf = TFMessage((TransformStamped(header(t, "world"), "drone1/base_link"),) * 2)
            result.append(("/tf", tf, t - 8_000_000))
    return result


def write(path, entries, metadata=None, attachments=None, flush_each=0):
    with LogWriter(path, metadata or {}, attachments or {}) as log:
        for k, (topic, message, t) in enumerate(entries):
            log.write(topic, type(message), message.encode(), t)
            if flush_each and k % flush_each == 0:
                log.flush()
    return log.metadata["digest"]


def expected(entries):
    ordered = sorted(entries, key=lambda entry: entry[2])
    return [(topic, message.type_name, t, message.encode()) for topic, message, t in ordered]


@pytest.fixture
def path(tmp_path):
    return tmp_path / "run.mcap"


@pytest.mark.parametrize("flush_each", [0, 1, 50])
def test_log_is_read_in_order_of_time_then_writing(path, flush_each):
    entries = messages()
    digest = write(path, entries, {"seed": "7"}, {"scene.toml": b"a = 1\n"}, flush_each)
    with LogReader(path) as log:
        assert log.complete
        assert log.metadata == {"seed": "7", "digest": digest}
        assert log.attachments == {"scene.toml": b"a = 1\n"}
        assert log.topics() == {
            "/clock": "rosgraph_msgs/msg/Clock",
            "/drone1/imu": "sensor_msgs/msg/Imu",
            "/tf": "tf2_msgs/msg/TFMessage",
        }
        assert list(log.messages()) == expected(entries)
        assert log.digest() == digest


@pytest.mark.parametrize("flush_each", [0, 20])
def test_log_is_read_by_topic_and_time(path, flush_each):
    entries = messages()
    write(path, entries, flush_each=flush_each)
    with LogReader(path) as log:
        some = list(log.messages(["/tf", "/clock"], start_ns=100_000_000, end_ns=500_000_000))
        assert some == [e for e in expected(entries) if e[0] != "/drone1/imu" and 100_000_000 <= e[2] < 500_000_000]
        with pytest.raises(ValueError, match="has no topic /mag; it has /clock, /drone1/imu, /tf"):
            next(log.messages(["/mag"]))


def test_log_may_be_read_twice_at_once(path):
    entries = messages()
    write(path, entries, flush_each=20)
    with LogReader(path) as log:
        pairs = list(zip(log.messages(), log.messages(), strict=True))
        assert all(a == b for a, b in pairs)


def test_digest_depends_on_content_only(tmp_path):
    entries = messages()
    by_topic = sorted(entries, key=lambda entry: entry[0])
    digests = {
        write(tmp_path / "a", entries),
        write(tmp_path / "b", by_topic),
        write(tmp_path / "c", by_topic, None, None, 7),
    }
    assert len(digests) == 1
    reference = Digest()
    for topic, message, t in entries:
        reference.update(topic, t, message.encode())
    assert digests == {reference.hexdigest()}
    assert write(tmp_path / "d", entries[:-1]) not in digests


def test_digest_ignores_nondeterministic_messages(tmp_path):
    entries = messages(10)
    with LogWriter(tmp_path / "a", {}, {}) as log:
        for topic, message, t in entries:
            log.write(topic, message.type_name, message.encode(), t)
        log.write("/wall_time", WallTime, WallTime(header(0, ""), 1.7e9, 3.0).encode(), 0, deterministic=False)
        digest = log.digest
    assert digest == write(tmp_path / "b", entries)
    with LogReader(tmp_path / "a") as read:
        assert read.digest() == digest
        assert "/wall_time" in read.topics()


def test_mcap_library_reads_log_with_matching_summary(path):
    entries = messages()
    digest = write(path, entries, {"seed": "7"}, {"scene.toml": b"x"}, flush_each=40)
    with open(path, "rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        assert reader.get_header().profile == "ros2"
        summary = reader.get_summary()
        statistics = summary.statistics
        assert statistics.message_count == len(entries)
        assert (statistics.message_start_time, statistics.message_end_time) == (0, 299 * 4_000_000)
        assert statistics.channel_count == statistics.schema_count == 3
        assert sum(statistics.channel_message_counts.values()) == len(entries)
        assert statistics.chunk_count == len(summary.chunk_indexes) > 10
        assert {record.name: record.metadata for record in reader.iter_metadata()}["lapwing_end"]["digest"] == digest
        raw = [(c.topic, s.name, m.log_time, m.data) for s, c, m in reader.iter_messages()]
        assert raw == expected(entries)
        assert all(m.publish_time == m.log_time for _, _, m in reader.iter_messages())
        sequence = [m.sequence for _, _, m in reader.iter_messages(topics=["/drone1/imu"])]
        assert sequence == list(range(300))
        imu = [m for _, _, _, m in reader.iter_decoded_messages(topics=["/drone1/imu"])]
        ours = [message for topic, message, _ in entries if topic == "/drone1/imu"]
        assert [m.linear_acceleration.x for m in imu] == [m.linear_acceleration[0] for m in ours]
        assert imu[0].header.frame_id == "drone1/base_link"


def test_rosbags_library_reads_log(path):
    entries = messages()
    entries.append(("/drone1/status", Status(header(5, ""), "auto", "hover", True), 5))
    write(path, entries, flush_each=40)
    with AnyReader([path]) as reader:
        assert reader.message_count == len(entries)
        result = [(c.topic, c.msgtype, t, bytes(raw)) for c, t, raw in reader.messages()]
        assert sorted(result) == sorted(expected(entries))
        status = [c for c in reader.connections if c.topic == "/drone1/status"]
        (_, _, raw) = next(reader.messages(status))
        decoded = reader.deserialize(raw, "lapwing_msgs/msg/Status")
        assert (decoded.mode, decoded.phase, decoded.armed, decoded.landed) == ("auto", "hover", True, False)


def test_empty_log_is_complete(path):
    digest = write(path, [])
    with LogReader(path) as log:
        assert (list(log.messages()), log.topics(), log.complete) == ([], {}, True)
        assert log.digest() == digest


def test_log_of_killed_writer_is_readable(path):
    code = textwrap.dedent(
        f"""
        import os, signal
        from lapwing.messages import Clock, stamp
        from lapwing.cosim.log import LogWriter
        log = LogWriter({str(path)!r}, {{"seed": "7"}}, {{"scene.toml": b"x"}})
        for k in range(1000):
            log.write("/clock", Clock, Clock(stamp(k)).encode(), k)
        log.flush()
        log.write("/clock", Clock, Clock(stamp(1000)).encode(), 1000)
        os.kill(os.getpid(), signal.SIGKILL)
        """
    )
    done = subprocess.run([sys.executable, "-c", code], check=False, capture_output=True, text=True)
    assert done.returncode == -signal.SIGKILL, done.stderr
    with LogReader(path) as log:
        assert not log.complete
        assert log.metadata == {"seed": "7"}
        assert log.attachments == {"scene.toml": b"x"}
        assert [t for _, _, t, _ in log.messages()] == list(range(1000))


def test_truncated_log_is_read_to_last_complete_chunk(path, tmp_path):
    entries = messages(60)
    write(path, entries, flush_each=20)
    whole = path.read_bytes()
    counts = []
    for size in range(8, len(whole), 97):
        part = tmp_path / "part.mcap"
        part.write_bytes(whole[:size])
        with LogReader(part) as log:
            assert log.complete == (size >= len(whole) - 8)
            counts.append(len(list(log.messages())))
    assert counts == sorted(counts)
    assert counts[0] == 0
    assert counts[-1] == len(entries)


def test_paused_writer_flushes_with_next_message(path, monkeypatch):
    now = [0.0]
    monkeypatch.setattr("lapwing.cosim.log.log_writer.time.monotonic", lambda: now[0])
    log = LogWriter(path, {}, {})
    for k in range(3):
        log.write("/clock", Clock, Clock().encode(), k)
    now[0] = 0.6
    log.write("/clock", Clock, Clock().encode(), 3)
    log._wait()
    with LogReader(path) as read:
        assert len(list(read.messages())) == 4
    log.close()


def test_unusable_files_raise_clear_errors(path, tmp_path):
    with pytest.raises(ValueError, match="cannot write the log: No such file"):
        LogWriter(tmp_path / "missing" / "run.mcap", {}, {})
    with pytest.raises(ValueError, match="cannot write the log: Is a directory"):
        LogWriter(tmp_path, {}, {})
    with pytest.raises(ValueError, match="cannot be read: no such file"):
        LogReader(path)
    for text, message in ((b"", "is empty"), (b"hello, this is text", "not an MCAP file")):
        path.write_bytes(text)
        with pytest.raises(ValueError, match=message):
            LogReader(path)


def test_damaged_chunk_is_named(path):
    write(path, messages(100))
    data = bytearray(path.read_bytes())
    data[len(data) // 3] ^= 0xFF
    path.write_bytes(data)
    with pytest.raises(ValueError, match="damaged chunk at byte") as caught, LogReader(path) as log:
        list(log.messages())
    assert "\n" not in str(caught.value)


def test_full_disk_is_clear_error():
    with pytest.raises(ValueError, match="/dev/full: cannot write the log: No space left"):
        write("/dev/full", messages(5))


def test_unknown_type_name_is_rejected(path):
    with LogWriter(path, {}, {}) as log, pytest.raises(ValueError, match="unknown message type a/msg/B"):
        log.write("/a", "a/msg/B", b"", 0)
