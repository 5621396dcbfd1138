"""Arming is blocked by lasting conditions, not by a single rejected reading."""

import pytest
from commander_session import CONSTANTS, Session

from lapwing.services.autopilot.estimator import SOURCES
from lapwing.services.autopilot.initial_estimate import EXACT, NOT_STARTED


def shown(bits, seconds, constants=CONSTANTS):
    """The reasons after these bits of health for so long."""
    session = Session(constants._replace(has_trajectory=False))
    session.step(estimate=EXACT, estimate_interval=0.02)
    for _ in range(round(seconds / 0.02)):
        request = session.step(estimate=EXACT._replace(health=bits), estimate_interval=0.02)
    return list(request.status.arming_blockers), session.commander.state.source_outage


def test_only_absent_source_blocks_arming():
    for bit, name in enumerate(SOURCES):
        assert shown(1 << bit, 0.1)[0] == []
        assert shown(1 << bit, 1.0)[0] == [f"no good readings of the {name}"]


def test_uncertain_estimate_is_reason_at_once():
    assert shown(64, 0.02)[0] == ["the position is uncertain"]
    assert shown(128, 0.02)[0] == ["the attitude is uncertain"]
    assert shown(NOT_STARTED, 0.02)[0] == ["the estimator has not started"]


def test_time_counts_at_new_estimates_alone():
    session = Session(CONSTANTS._replace(has_trajectory=False))
    lost = EXACT._replace(health=1)
    for tick in range(1000):
        session.step(estimate=lost, estimate_interval=0.02 if tick % 5 == 0 else 0.0)
    assert session.commander.state.source_outage[0] == pytest.approx(200 * 0.02)


def test_without_operator_no_arming_or_timeouts():
    blockers, outage = shown(1, 1.0, CONSTANTS._replace(has_operator=False))
    assert blockers == []
    assert outage == [0.0] * len(SOURCES)
