"""How long a study still takes."""

import io
import re

import pytest
from rich.console import Console

from lapwing.cli.study_progress import Countdown, left


def test_time_left_is_that_of_the_mean_flight():
    assert left(30.0, 3, 10) == "about 70 s left"
    assert left(300.0, 3, 10) == "about 12 min left"
    assert left(30.0, 0, 10) == left(30.0, 10, 10) == ""


@pytest.mark.parametrize(
    ("terminal", "expected"),
    [(True, "2 of 10 flights"), (False, r"2 of 10 flights, about \d+ (s|min) left: without \[gravity\]\n")],
)
def test_a_terminal_has_a_bar_and_anything_else_lines(terminal, expected):
    console = Console(file=io.StringIO(), force_terminal=terminal, width=100, markup=False)
    with Countdown(console) as countdown:
        countdown.say("without [gravity]", 2, 10)
        if countdown._bar:
            countdown._bar.refresh()
        assert re.search(expected, console.file.getvalue())
