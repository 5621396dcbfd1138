"""Arming is blocked by lasting conditions, not by a single rejected reading."""

import pytest
from commander_session import CONSTANTS, Session

from lapwing.services.autopilot.commander.prearm_checks import NOT_STARTED
from lapwing.services.autopilot.estimator import SOURCES
from lapwing.services.common.ports import StateEstimate


def with_sonar(constants=CONSTANTS):
    """Return a session of a vehicle with every source; the true state of the scene replaces all except the sonar."""
    session = Session(constants._replace(has_trajectory=False))
    session.commander.state.guidance.parameters["SYS_HAS_NUM_DIST"] = 1.0
    return session


def blockers_after(bits, seconds, constants=CONSTANTS):
    """Return the arming blockers after a time with these health bits."""
    session = with_sonar(constants)
    session.step(estimate=StateEstimate(), estimate_interval=0.02)
    for _ in range(round(seconds / 0.02)):
        request = session.step(estimate=StateEstimate(health=bits), estimate_interval=0.02)
    return list(request.status.arming_blockers), session.commander.state.source_outage


def test_only_absent_source_blocks_arming():
    for bit, name in enumerate(SOURCES):
        assert blockers_after(1 << bit, 0.1)[0] == []
        assert blockers_after(1 << bit, 1.0)[0] == [f"no good readings of the {name}"]


def test_uncertain_estimate_blocks_arming_immediately():
    assert blockers_after(64, 0.02)[0] == ["the position is uncertain"]
    assert blockers_after(128, 0.02)[0] == ["the attitude is uncertain"]
    assert blockers_after(NOT_STARTED, 0.02)[0] == ["the estimator has not started"]


def test_outage_time_counts_only_new_estimates():
    session = Session(CONSTANTS._replace(has_trajectory=False))
    lost = StateEstimate(health=1)
    for tick in range(1000):
        session.step(estimate=lost, estimate_interval=0.02 if tick % 5 == 0 else 0.0)
    assert session.commander.state.source_outage[0] == pytest.approx(200 * 0.02)


def test_commander_without_operator_has_no_arming_checks():
    blockers, outage = blockers_after(1, 1.0, CONSTANTS._replace(has_operator=False))
    assert blockers == []
    assert outage == [0.0] * len(SOURCES)


@pytest.mark.parametrize(
    ("source", "parameter"),
    [("magnetometer", "SYS_HAS_MAG"), ("barometer", "SYS_HAS_BARO"), ("sonar", "SYS_HAS_NUM_DIST")],
)
def test_sensor_blocks_arming_only_if_required(source, parameter):
    session = with_sonar()
    bits = 1 << SOURCES.index(source)
    for required, blockers in ((1.0, (f"no good readings of the {source}",)), (0.0, ())):
        session.commander.state.guidance.parameters[parameter] = required
        for _ in range(50):
            request = session.step(estimate=StateEstimate(health=bits), estimate_interval=0.02)
        assert request.status.arming_blockers == blockers
    for other in set(SOURCES) - {source}:
        for _ in range(50):
            request = session.step(estimate=StateEstimate(health=1 << SOURCES.index(other)), estimate_interval=0.02)
        assert request.status.arming_blockers == (f"no good readings of the {other}",)
