"""Simultaneous runs end with complete logs; `python -m tests.faults.stress` runs any number of them."""

import pytest

from tests.faults.stress import trial

RUNS, AT_ONCE = 60, 6


@pytest.mark.long
def test_simultaneous_runs_lose_no_message():
    results = list(trial(RUNS, AT_ONCE, 0))
    assert len(results) == RUNS
    assert [result for result in results if result.wrong] == []
