"""How flights made up end: each verdict, its time and its words."""

import numpy as np
import pytest
import synthetic_flights

from lapwing.studies.outcome import judge

TICKS, RATE = 500, 100
T = np.arange(TICKS) / RATE
UP = np.array([0.0, 0.0, 1.0])
ON_ITS_BACK = (1.0, 0.0, 0.0, 0.0)


def flown(finished=True, landed=True, failure="", diverged=False, status=None, **truth):
    """Up at 1 s, down at 4 s at 0.4 m/s, and standing at (1, 2)."""
    contact = (T < 1.0) | (T >= 4.0)
    columns = {
        "pose.position": np.array([1.0, 2.0, 0.35]),
        "pose.orientation": synthetic_flights.LEVEL,
        "velocity": np.where(contact, 0.0, -0.4)[:, None] * UP,
        "ground_contact": contact,
    }
    last = {"finished": finished & (T > 4.5), "landed": landed & contact, "armed": ~contact}
    words = {"mode": "mission", "phase": np.where(T < 3.0, "hover", "land")}
    said = synthetic_flights.flight(
        TICKS, RATE, failure, diverged, truth=columns | truth, status=last | words | (status or {})
    )
    return said.verdict


def test_a_landing_says_when_how_hard_and_where():
    found = flown()
    assert (found.kind, found.time, found.tilt) == ("landed", 4.0, 0.0)
    assert found.touchdown == pytest.approx(0.4)
    assert str(found) == (
        "Landed at 4.00 s: upright on its feet, touched down at 0.40 m/s; ends at (1.00, 2.00, 0.35) m"
    )


def test_upside_down_is_no_landing_whatever_the_autopilot_says():
    found = flown(**{"pose.orientation": np.where((T > 3.0)[:, None], ON_ITS_BACK, synthetic_flights.LEVEL)})
    assert (found.kind, found.time) == ("crashed", pytest.approx(3.01))
    assert found.how == "turned over"
    assert found.tilt == pytest.approx(np.pi)


def test_a_hard_touch_is_a_crash_and_what_followed_is_told():
    turned = np.where((T > 4.2)[:, None], ON_ITS_BACK, synthetic_flights.LEVEL)
    contact = (T < 1.0) | (T >= 4.0)
    fast = np.where(contact, 0.0, -5.3)[:, None] * UP
    found = flown(velocity=fast, **{"pose.orientation": turned})
    assert str(found).startswith("Crashed at 4.00 s: hit the ground at 5.3 m/s, turned over at 4.21 s; ends at")


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"velocity": np.array([0.6, 0.0, 0.0])}, "moves at 0.6 m/s"),
        ({"pose.orientation": (np.sin(np.radians(20.0)), 0.0, 0.0, np.cos(np.radians(20.0)))}, "tilted by 40°"),
        ({"landed": False}, "the autopilot does not say that it has landed"),
        ({"ground_contact": T < 1.0, "pose.position": np.outer(T, UP)}, "not on the ground"),
    ],
)
def test_who_does_not_stand_when_the_mission_is_over_has_crashed(changed, said):
    found = flown(**changed)
    assert found.kind == "crashed"
    assert said in found.how


def test_a_bounce_is_a_part_of_its_touch():
    bouncing = (T < 1.0) | ((T >= 3.9) & (T < 3.92)) | (T >= 4.0)
    assert flown(ground_contact=bouncing).time == 3.9


def test_a_mission_that_is_not_over_has_timed_out_and_says_in_what():
    found = flown(finished=False)
    assert (found.kind, found.time) == ("timed out", 4.99)
    assert found.how == "the mission was not over, in mission (land)"
    grounded = flown(finished=False, status={"armed": False})
    assert grounded.how == "the mission was not over, the motors were never armed"


def test_under_an_operator_disarmed_after_a_flight_is_over():
    assert flown(finished=False, status={"mode": "hold"}).kind == "landed"


def test_divergence_and_other_ends_before_the_time():
    assert str(flown(failure="not finite at t = 5 s", diverged=True)) == "Diverged at 4.99 s: not finite at t = 5 s"
    assert str(flown(failure="ended by SIGINT", finished=False)) == "Broken off at 4.99 s: ended by SIGINT"


def test_where_nobody_steers_nothing_has_to_land():
    found = synthetic_flights.moved([0.0, 1.0, 2.0])
    assert (found.verdict.kind, found.landed) == ("flown", False)
    assert judge(found.truth, None).kind == "flown"
