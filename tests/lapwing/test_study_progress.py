"""Remaining time of a study."""

import io
import re

import pytest
from rich.console import Console

from lapwing.cli.progress import StudyProgress
from lapwing.runs.work_progress import TimeLeft


class Clock:
    """Clock that a test sets."""

    now = 0.0

    def __call__(self):
        return self.now


def left(*reports, total):
    """Text after reports (seconds, done)."""
    clock = Clock()
    remaining = TimeLeft(clock)
    for clock.now, done in reports:
        remaining.done(done)
    return remaining.text(total)


def test_time_left_is_that_of_equal_flights():
    assert left((10.0, 1), (20.0, 2), (30.0, 3), total=10) == "about 70 s left"
    assert left((100.0, 1), (200.0, 2), (300.0, 3), total=10) == "about 12 min left"


def test_time_left_forgets_start_of_workers():
    assert left((120.0, 10), (121.0, 20), (122.0, 30), total=100) == "about 7 s left"


def test_time_left_is_unknown_after_one_report_and_at_end():
    assert left((30.0, 1), total=10) == left((10.0, 5), (20.0, 10), total=10) == ""


def test_time_left_counts_down_between_reports():
    clock = Clock()
    remaining = TimeLeft(clock)
    for clock.now, done in ((10.0, 1), (20.0, 2)):
        remaining.done(done)
    clock.now = 25.0
    assert remaining.seconds(4) == pytest.approx(15.0)


@pytest.mark.parametrize(
    ("terminal", "expected"),
    [(True, "2 of 10 flights"), (False, r"2 of 10 flights, about \d+ (s|min) left: without \[gravity\]\n")],
)
def test_terminal_has_bar_and_anything_else_lines(terminal, expected):
    console = Console(file=io.StringIO(), force_terminal=terminal, width=100, markup=False)
    with StudyProgress(console) as countdown:
        countdown.say("nominal", 1, 10)
        countdown.say("without [gravity]", 2, 10)
        if countdown._bar:
            countdown._bar.refresh()
        assert re.search(expected, console.file.getvalue())
