"""Replay: timing, keys, and a recording with the digest of the replayed log."""

import os
import pty
import random
import select
import subprocess
import sys
import termios
import time

import numpy as np
import pytest

from lapwing.cli.log_playback import Keyboard
from lapwing.cosim.log import LogReader, LogWriter
from lapwing.cosim.transport.bus import ZenohBus
from lapwing.messages import Clock, stamp
from lapwing.messages.digest import Digest
from lapwing.messages.topics import CLOCK
from lapwing.services.replay import player
from lapwing.services.replay.playback_timing import Cut, Pace, schedule
from tests.commands import assert_rejected, run_command
from tests.endpoints import loopback_endpoints

pytestmark = pytest.mark.long

TICK = 4_000_000
PATIENCE = 300.0  # [s] for a player that starts on a busy machine


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


def test_speed_scales_time_between_messages():
    assert [due.wait for due in schedule(messages(3), 2.0)] == pytest.approx([0.0, 0.002, 0.004])


def test_all_messages_are_due_at_once_at_maximum_speed():
    assert [due.wait for due in schedule(messages(3), None)] == [0.0, 0.0, 0.0]


def test_time_starts_at_first_selected_message(log):
    cut = Cut.of(0.1, 0.2)
    with LogReader(log) as source:
        due = list(schedule(source.messages(None, cut.start_ns, cut.end_ns), 1.0))
    assert due[0].time_ns == 100_000_000
    assert due[0].wait == 0.0
    assert due[-1].time_ns == 200_000_000
    assert due[-1].wait == pytest.approx(0.1)


def test_recorded_replay_has_equal_digest(log, tmp_path):
    again = tmp_path / "again.mcap"
    key_prefix, (endpoint,) = "test-record", loopback_endpoints(["a"]).values()
    command = replay(log, "--speed", "max", "--record", again, "--key-prefix", key_prefix, "--listen", endpoint)
    subprocess.run(command, check=True, timeout=PATIENCE)
    with LogReader(log) as first, LogReader(again) as second:
        assert first.metadata["digest"] == second.metadata["digest"] == second.digest()
        assert second.metadata["seed"] == "1"
        assert dict(second.attachments) == dict(first.attachments)
        assert second.deterministic_topics() == {"/clock"}


def test_subscriber_gets_every_message_in_order(log):
    key_prefix, (endpoint,) = "test-subscriber", loopback_endpoints(["a"]).values()
    with subprocess.Popen(replay(log, "--speed", "max", "--key-prefix", key_prefix, "--listen", endpoint)) as player:
        with ZenohBus(connect=[endpoint]) as bus:
            arriving = bus.subscribe(f"{key_prefix}/clock")
            digest = Digest()
            for _ in range(200):
                time_ns, payload = arriving.get(timeout=PATIENCE)
                digest.update("/clock", time_ns, payload)
        assert player.wait(PATIENCE) == 0
    with LogReader(log) as source:
        assert digest.hexdigest() == source.digest()


def test_replay_waits_for_confirmation_of_its_end(log):
    key_prefix, (endpoint,) = "test-confirmed", loopback_endpoints(["a"]).values()
    command = replay(log, "--speed", "max", "--key-prefix", key_prefix, "--listen", endpoint)
    with subprocess.Popen(command) as player, ZenohBus(connect=[endpoint]) as bus:
        arriving = bus.subscribe(f"{key_prefix}/clock")
        bus.declare_liveliness(f"{key_prefix}/_alive/slow")
        payloads = [arriving.get(timeout=PATIENCE)[1]]
        while payloads[-1]:
            payloads.append(arriving.get(timeout=PATIENCE)[1])
        time.sleep(1.0)
        assert player.poll() is None
        bus.declare_liveliness(f"{key_prefix}/_heard/slow")
        assert player.wait(PATIENCE) == 0
    assert len(payloads) == 201


def test_signal_ends_loop_at_once(log):
    key_prefix, (endpoint,) = "test-signal", loopback_endpoints(["a"]).values()
    with subprocess.Popen(replay(log, "--loop", "--key-prefix", key_prefix, "--listen", endpoint)) as player:
        with ZenohBus(connect=[endpoint]) as bus:
            assert bus.subscribe(f"{key_prefix}/clock").get(timeout=PATIENCE) is not None
        requested = time.monotonic()
        player.terminate()
        assert player.wait(PATIENCE) == 143
        assert time.monotonic() - requested < 10.0


@pytest.mark.parametrize(
    ("arguments", "output"),
    [
        (["missing.mcap"], "missing.mcap"),
        (["LOG", "--from", "-1"], "--from -1"),
        (["LOG", "--from", "2", "--to", "1"], "--to 1"),
        (["LOG", "--from", "99", "--speed", "max"], "no message"),
        (["LOG", "--topics", "/imu"], "the log has no topic /imu; it has /clock, /other"),
        (["LOG", "--speed", "0"], "--speed 0"),
        (["LOG", "--record", "/proc/none/x.mcap"], "/proc/none/x.mcap"),
        (["LOG", "--record", "LOG"], "is the replayed log"),
        (["LOG", "--listen", "nonsense"], "nonsense"),
    ],
)
def test_unreplayable_log_is_rejected_in_single_line(log, arguments, output):
    arguments = [str(log) if a == "LOG" else a for a in arguments]
    (endpoint,) = loopback_endpoints(["a"]).values()
    values = [] if "--listen" in arguments else ["--listen", endpoint]
    assert_rejected(run_command("replay", *arguments, *values, "--key-prefix", "test-error"), output)


def test_equal_times_keep_their_order_through_three_generations(tmp_path, monkeypatch):
    monkeypatch.setattr(player, "SUBSCRIBER_TIMEOUT", 0.0)
    path, rng = tmp_path / "0.mcap", random.Random(1)
    with LogWriter(path, {}, {}) as writer:
        for tick in range(60):
            for topic in rng.choices("dbac", k=6):  # also one topic several times at an instant
                writer.write(f"/{topic}", Clock, Clock(stamp(rng.randrange(1000))).encode(), tick * TICK)
            if tick % 7 == 0:
                writer.flush()
    with LogReader(path) as log:
        first = list(log.messages())
    assert [m[2] for m in first] == sorted(m[2] for m in first)
    for k in (1, 2, 3):
        (endpoint,) = loopback_endpoints(["a"]).values()
        again = tmp_path / f"{k}.mcap"
        player.play(path, f"test-generations{k}", endpoint, Cut(0, None), None, False, again, lambda: False)
        path = again
        with LogReader(path) as log:
            assert list(log.messages()) == first


def test_only_named_topics_are_replayed(log, tmp_path, monkeypatch):
    monkeypatch.setattr(player, "SUBSCRIBER_TIMEOUT", 0.0)
    (endpoint,) = loopback_endpoints(["a"]).values()
    received, record = [], tmp_path / "a.mcap"
    say = lambda topic, time_ns, payload: received.append((topic, time_ns))  # noqa: E731
    count = player.play(
        log, "test-topics", endpoint, Cut(0, None), None, False, record, lambda: False, say, topics=["/other"]
    )
    assert (count, received) == (1, [("/other", 200 * TICK)])
    with LogReader(record) as read:
        assert list(read.topics()) == ["/other"]


class Terminal:
    """Clock that only advances while waiting, and keys typed at given times."""

    def __init__(self, typed):
        self.now, self.typed, self.printed = 0.0, dict(typed), []

    def keys(self):
        due = [at for at in self.typed if at <= self.now]
        return "".join(self.typed.pop(at) for at in sorted(due))

    def wait(self, seconds):
        self.now += seconds

    def went(self, messages):
        """Return the wall time of each message (due [s], time [ns])."""
        pace, result = Pace(self.keys, self.printed.append, self.wait, lambda: self.now), []
        for due, time_ns in messages:
            pace.wait(due, time_ns, lambda: self.now > 100.0)
            if pace.quit or self.now > 100.0:
                break
            result.append(self.now)
        return result


def test_messages_after_pause_keep_their_distance():
    terminal = Terminal({1.5: " ", 6.0: " "})
    went = terminal.went([(float(k), k) for k in range(5)])
    assert went[:2] == pytest.approx([0.0, 1.0], abs=0.03)
    assert went[2] == pytest.approx(6.0, abs=0.03)
    assert np.diff(went[2:]) == pytest.approx([1.0, 1.0], abs=0.03)
    assert [line.split()[0] for line in terminal.printed] == ["paused", "resumed"]


def test_step_publishes_all_messages_of_one_instant():
    terminal = Terminal({0.5: " ", 10.0: ".", 20.0: ".", 30.0: "q"})
    went = terminal.went([(0.0, 0), (1.0, 7), (1.0, 7), (2.0, 9), (3.0, 11)])
    assert went == pytest.approx([0.0, 10.0, 10.0, 20.0], abs=0.05)
    assert terminal.now == pytest.approx(30.0, abs=0.05)


def test_single_step_key_is_ignored_without_pause():
    assert Terminal({0.5: "."}).went([(0.0, 0), (1.0, 1)]) == pytest.approx([0.0, 1.0], abs=0.03)


def test_terminal_keys_are_read_and_terminal_is_restored():
    ours, theirs = pty.openpty()
    before = termios.tcgetattr(theirs)
    with Keyboard(theirs) as keyboard:
        assert keyboard.keys() == ""
        os.write(ours, b" .")
        assert select.select([theirs], [], [], 10.0)[0]
        assert keyboard.keys() == " ."
    assert termios.tcgetattr(theirs) == before
    reading, writing = os.pipe()
    os.write(writing, b"q")
    with Keyboard(reading) as keyboard:  # not a terminal: the input belongs to another program
        assert keyboard.keys() == ""
    for descriptor in (ours, theirs, reading, writing):
        os.close(descriptor)
