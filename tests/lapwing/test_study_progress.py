"""Remaining time of a study."""

import heapq
import io
import re

import numpy as np
import pytest
from rich.console import Console

from lapwing.cli.progress import RunProgress, StudyProgress, step_progress
from lapwing.messages import Status
from lapwing.runs.work_progress import TimeLeft, WorkProgress


class Clock:
    """Clock that a test sets."""

    now = 0.0

    def __call__(self):
        return self.now


def left(*reports, total):
    """Return the text of the remaining time after reports (seconds, done)."""
    clock = Clock()
    remaining = TimeLeft(clock=clock)
    for clock.now, done in reports:
        remaining.done(done)
    return remaining.text(total)


def finishes(durations, workers):
    """Return the times at which the parts of some work are finished by workers that each take the next one."""
    free, result = [0.0] * workers, []
    for duration in durations:
        start = heapq.heappop(free)
        heapq.heappush(free, start + duration)
        result.append(start + duration)
    return sorted(result)


def constant(rng, workers):
    return np.full(240, 3.0)


def compiled_first(rng, workers):
    return np.where(np.arange(240) < workers, 200.0, 1.0)


def jitter(rng, workers):
    return 3.0 * rng.uniform(0.97, 1.03, 240)


def unequal(rng, workers):
    return rng.uniform(1.0, 5.0, 240)


def accelerating(rng, workers):
    return np.linspace(4.0, 2.0, 240)  # the machine gets free


@pytest.mark.parametrize("workers", [1, 2, 8])
@pytest.mark.parametrize("work", [constant, compiled_first, jitter, unequal, accelerating])
def test_estimate_is_within_half_of_truth_after_tenth_of_work(work, workers):
    times = finishes(work(np.random.default_rng(1), workers), workers)
    clock = Clock()
    remaining, ratios = TimeLeft(workers, clock), []
    for done, clock.now in enumerate(times, 1):
        remaining.done(done)
        if 24 <= done <= 192:  # later the last parts, which end together, are a large part of the rest
            ratios.append(remaining.seconds(240) / (times[-1] - clock.now))
    assert min(ratios) > 1.0 / 1.5
    assert max(ratios) < 1.5


def test_no_estimate_without_basis():
    assert left((200.0, 1), total=10) == ""  # compilation
    assert left((200.0, 1), (200.4, 2), total=10) == ""  # too short to measure
    assert left((200.0, 1), (202.0, 2), total=1000) == ""  # a thousandth of the work


def test_no_estimate_of_work_with_unknown_workers():
    clock = Clock()
    remaining = TimeLeft(0, clock)
    for clock.now in range(1, 100):
        remaining.done(clock.now)
    assert remaining.text(200) == ""


def test_no_estimate_from_first_burst_of_workers():
    clock = Clock()
    remaining = TimeLeft(4, clock)
    for clock.now, done in ((60.0, 1), (60.1, 2), (62.0, 3), (63.0, 4), (120.0, 5), (121.0, 6)):
        remaining.done(done)
        assert remaining.seconds(40) is None


def test_time_left_assumes_equal_flights():
    assert left((10.0, 1), (20.0, 2), (30.0, 3), total=10) == "about 70 s left"
    assert left((100.0, 1), (200.0, 2), (300.0, 3), total=10) == "about 12 min left"


def test_time_left_forgets_start_of_workers():
    assert left((120.0, 10), (121.0, 20), (122.0, 30), total=100) == "about 7 s left"


def test_time_left_is_unknown_after_one_report_and_at_end():
    assert left((30.0, 1), total=10) == left((10.0, 5), (20.0, 10), total=10) == ""


def test_time_left_counts_down_between_reports():
    clock = Clock()
    remaining = TimeLeft(clock=clock)
    for clock.now, done in ((10.0, 1), (20.0, 2)):
        remaining.done(done)
    clock.now = 25.0
    assert remaining.seconds(4) == pytest.approx(15.0)


def test_work_that_may_end_early_has_upper_bound():
    bar = WorkProgress("delivery_mission", 120.0, "s")
    bar._left._clock = clock = Clock()
    bar._left._start = 0.0
    for clock.now in (3.0, 6.0, 9.0, 12.0):
        bar.show(clock.now)
    assert bar.state() == (0.1, "delivery_mission: 12.0 of 120 s, at most about 2 min left")


@pytest.mark.parametrize(
    ("terminal", "expected"), [(True, "2 of 10 flights"), (False, r"2 of 10 flights: without \[gravity\]\n")]
)
def test_terminal_has_bar_and_other_streams_have_lines(terminal, expected):
    console = Console(file=io.StringIO(), force_terminal=terminal, width=100, markup=False)
    with StudyProgress(console, "flights") as countdown:
        countdown.say("nominal", 1, 10)
        countdown.say("without [gravity]", 2, 10)
        if countdown._bar:
            countdown._bar.refresh()
        assert re.search(expected, console.file.getvalue())


def test_progress_of_a_run_is_one_line_each(monkeypatch):
    monkeypatch.setattr("lapwing.cli.progress.LINE_PERIOD", 0.0)
    status = type("Decoded", (), {"phase": "item 5 of 7: go to 9.99 m north, 10 m east, 10 m up, by the shorter way"})
    monkeypatch.setattr(Status, "decode", lambda _: status)
    console = Console(file=io.StringIO(), width=80)
    with RunProgress(console, 100.0) as progress:
        progress.begin()
        progress.show(0, None, b"")
    assert console.file.getvalue().count("\n") == 1


@pytest.mark.parametrize(("announced", "expected"), [(True, "measuring reference ...\n"), (False, "")])
def test_only_announced_study_prints_a_line_without_terminal(capsys, announced, expected):
    with step_progress(Console(file=io.StringIO()), "parts", announced=announced) as say:
        for done, text in enumerate(("", "measuring reference", "measuring rkmk4")):
            say(text, done, 3)
    assert capsys.readouterr() == ("", expected)
