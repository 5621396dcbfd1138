"""Runs side by side end by themselves with complete logs; `python -m tests.faults.stress` has as many as one likes."""

import pytest

from tests.faults.stress import trial

RUNS, AT_ONCE = 60, 6


@pytest.mark.long
def test_runs_at_once_end_and_lose_no_message():
    results = list(trial(RUNS, AT_ONCE, 0))
    assert len(results) == RUNS
    assert [result for result in results if result.wrong] == []
