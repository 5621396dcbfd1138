"""Flights in a loop with a ground station; `python -m tests.faults.soak` flies for hours."""

import pytest

from tests.combinations import NIGHTLY
from tests.faults.soak import Use, grown, soak


@pytest.mark.long
@NIGHTLY
def test_flights_with_ground_station_leave_no_process_port_or_lock():
    flights = soak(["hover", "--set", "run.duration=3"], 600.0)
    first, second = next(flights), next(flights)
    assert first.wrong == second.wrong == []
    assert first.messages > 50
    assert first.use.threads > 10


def test_growth_is_found():
    flat = [Use(100 + k % 3, 40, 30, 50) for k in range(30)]
    assert grown(flat) == []
    leaking = [Use(100, 40 + k, 30, 50) for k in range(30)]
    assert [text.split()[0] for text in grown(leaking)] == ["files"]
