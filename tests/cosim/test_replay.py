"""Replay: timing is pure; what is published and recorded again has the log's digest."""

import subprocess
import sys
import time

import pytest

from cosim.bus import ZenohBus
from cosim.launcher import loopback_endpoints
from cosim.log import LogReader, LogWriter
from messages import Clock, stamp
from messages.digest import Digest
from messages.topics import CLOCK
from services.replay.schedule import Cut, schedule

TICK = 4_000_000


@pytest.fixture
def log(tmp_path):
    """200 clock messages, 4 ms apart, and one that is not reproducible."""
    path = tmp_path / "flight.mcap"
    with LogWriter(path, {"seed": "1"}, {"scene.toml": b"# none"}) as writer:
        for tick in range(200):
            writer.write(CLOCK.key(), Clock, Clock(stamp(tick * TICK)).encode(), tick * TICK)
        writer.write("/other", Clock, Clock().encode(), 200 * TICK, deterministic=False)
    return path


def replay(*arguments):
    return [sys.executable, "-m", "lapwing", "replay", *map(str, arguments)]


def messages(n):
    return [("/clock", "", k * TICK, b"") for k in range(n)]


def test_speed_scales_the_time_between_messages():
    assert [due.wait for due in schedule(messages(3), 2.0)] == pytest.approx([0.0, 0.002, 0.004])


def test_at_top_speed_everything_is_due_at_once():
    assert [due.wait for due in schedule(messages(3), None)] == [0.0, 0.0, 0.0]


def test_time_counts_from_the_first_message_of_the_cut(log):
    cut = Cut.of(0.1, 0.2)
    with LogReader(log) as source:
        due = list(schedule(source.messages(None, cut.start_ns, cut.end_ns), 1.0))
    assert due[0].time_ns == 100_000_000
    assert due[0].wait == 0.0
    assert due[-1].time_ns == 200_000_000
    assert due[-1].wait == pytest.approx(0.1)


def test_recording_a_replay_gives_the_same_digest(log, tmp_path):
    again = tmp_path / "again.mcap"
    key_prefix, (endpoint,) = "test-record", loopback_endpoints(["a"]).values()
    command = replay(log, "--speed", "max", "--record", again, "--key-prefix", key_prefix, "--listen", endpoint)
    subprocess.run(command, check=True, timeout=60)
    with LogReader(log) as first, LogReader(again) as second:
        assert first.metadata["digest"] == second.metadata["digest"] == second.digest()
        assert second.metadata["seed"] == "1"
        assert dict(second.attachments) == dict(first.attachments)
        assert second.deterministic_topics() == {"/clock"}


def test_a_subscriber_gets_every_message_in_order(log):
    key_prefix, (endpoint,) = "test-subscriber", loopback_endpoints(["a"]).values()
    with subprocess.Popen(replay(log, "--speed", "max", "--key-prefix", key_prefix, "--listen", endpoint)) as player:
        with ZenohBus(connect=[endpoint]) as bus:
            arriving = bus.subscribe(f"{key_prefix}/clock")
            digest = Digest()
            for _ in range(200):
                time_ns, payload = arriving.get(timeout=30.0)
                digest.update("/clock", time_ns, payload)
        assert player.wait(timeout=30) == 0
    with LogReader(log) as source:
        assert digest.hexdigest() == source.digest()


def test_a_signal_ends_a_loop_at_once(log):
    key_prefix, (endpoint,) = "test-signal", loopback_endpoints(["a"]).values()
    with subprocess.Popen(replay(log, "--loop", "--key-prefix", key_prefix, "--listen", endpoint)) as player:
        with ZenohBus(connect=[endpoint]) as bus:
            assert bus.subscribe(f"{key_prefix}/clock").get(timeout=30.0) is not None
        asked = time.monotonic()
        player.terminate()
        assert player.wait(timeout=30) == 143
        assert time.monotonic() - asked < 10.0


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["missing.mcap"], "missing.mcap"),
        (["LOG", "--from", "-1"], "--from -1"),
        (["LOG", "--from", "2", "--to", "1"], "--to 1"),
        (["LOG", "--from", "99", "--speed", "max"], "no message"),
        (["LOG", "--speed", "0"], "--speed 0"),
        (["LOG", "--record", "/proc/none/x.mcap"], "/proc/none/x.mcap"),
        (["LOG", "--record", "LOG"], "the log that is replayed"),
        (["LOG", "--listen", "nonsense"], "nonsense"),
    ],
)
def test_what_cannot_be_replayed_is_said_in_one_line(log, arguments, said):
    arguments = [str(log) if a == "LOG" else a for a in arguments]
    (endpoint,) = loopback_endpoints(["a"]).values()
    given = [] if "--listen" in arguments else ["--listen", endpoint]
    result = subprocess.run(
        replay(*arguments, *given, "--key-prefix", "test-error"),
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert result.returncode == 2
    assert result.stderr.startswith("lapwing: ")
    assert result.stderr.count("\n") == 1
    assert said in result.stderr
