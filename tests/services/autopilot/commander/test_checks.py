"""What hinders arming: what lasts, not a single reading that was refused."""

from services.autopilot.commander.checks import reasons
from services.autopilot.commander.pilot import Pilot
from services.autopilot.estimator import SOURCES
from services.autopilot.navigation import NOT_STARTED, NOTHING
from services.parameters import table
from services.scene import load


def pilot():
    return Pilot(table(load("scenes/hover.toml")), 0.35, 9.8, 0.4, False, True)


def seen(bits, seconds):
    """The reasons of a pilot who has seen these bits of health for so long."""
    p = pilot()
    p.look(NOTHING, 0.02)
    for _ in range(round(seconds / 0.02)):
        p.look(NOTHING._replace(health=bits), 0.02)
    return reasons(p)


def test_a_refused_reading_is_no_reason_but_a_source_that_stays_away_is():
    for bit, name in enumerate(SOURCES):
        assert seen(1 << bit, 0.1) == []
        assert seen(1 << bit, 1.0) == [f"no good readings of the {name}"]


def test_an_uncertain_estimate_is_a_reason_at_once():
    assert seen(64, 0.02) == ["the position is uncertain"]
    assert seen(128, 0.02) == ["the attitude is uncertain"]
    assert seen(NOT_STARTED, 0.02) == ["the estimator has not started"]
