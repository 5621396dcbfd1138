"""Simultaneous runs end with complete logs; `python -m tests.faults.stress` runs any number of them."""

import pytest

from tests.combinations import NIGHTLY
from tests.faults.stress import trial


@pytest.mark.nightly
@pytest.mark.long
@pytest.mark.parametrize("runs", [4, pytest.param(60, marks=NIGHTLY)])
def test_simultaneous_runs_lose_no_message(runs):
    results = list(trial(runs, min(runs, 6), 0))
    assert len(results) == runs
    assert [result for result in results if result.wrong] == []
