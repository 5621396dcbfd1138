"""Topic appended to a log: read in order of time; the log is unchanged if the topic cannot be added."""

import pytest
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader

from lapwing.cosim.log import LogReader, LogWriter
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
