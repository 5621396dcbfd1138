"""Outcome of synthetic flights: kind, time and circumstances."""

import numpy as np
import pytest
import synthetic_flights

import lapwing
from lapwing.studies.mission import Mission
from lapwing.studies.outcome import classify

TICKS, RATE = 500, 100
T = np.arange(TICKS) / RATE
UP = np.array([0.0, 0.0, 1.0])
ON_ITS_BACK = (1.0, 0.0, 0.0, 0.0)


def fly(mission=None, finished=True, landed=True, failure="", diverged=False, status=None, **truth):
    """Return the outcome of a flight up at 1 s and down at 4 s with 0.4 m/s, at rest at (1, 2)."""
    contact = (T < 1.0) | (T >= 4.0)
    columns = {
        "pose.position": np.array([1.0, 2.0, 0.35]),
        "pose.orientation": synthetic_flights.LEVEL,
        "velocity": np.where(contact, 0.0, -0.4)[:, None] * UP,
        "ground_contact": contact,
    }
    last = {"finished": finished & (T > 4.5), "landed": landed & contact, "armed": ~contact}
    modes = {"mode": "mission", "phase": np.where(T < 3.0, "hover", "land")}
    flight = synthetic_flights.flight(TICKS, RATE, ground_truth=columns | truth, status=last | modes | (status or {}))
    return classify(flight.truth, flight.status, failure, diverged, mission)


def failsafe(start, reason="GPS lost"):
    return {"failsafe": start <= T, "text": np.where(start <= T, reason, "")}


def test_landing_reports_time_speed_place_and_target_distance():
    outcome = fly(Mission((1.0, 2.5, 0.0)))
    assert (outcome.kind, outcome.time, outcome.tilt) == ("landed", 4.0, 0.0)
    assert outcome.touchdown == pytest.approx(0.4)
    assert outcome.target_distance == pytest.approx(0.5)
    assert str(outcome) == (
        "Landed at 4.00 s: upright on its feet, touched down at 0.40 m/s; ends at (1.00, 2.00, 0.35) m"
    )


def test_vehicle_that_slides_without_takeoff_never_took_off():
    hops = (T % 1.0 >= 0.2) | (T < 1.0)
    outcome = fly(Mission((13.0, 7.0, 0.0)), ground_contact=hops, status={"armed": T < 4.5})
    assert (outcome.kind, outcome.how) == ("timed out", "never took off")


def test_landing_far_from_target_is_landed_elsewhere():
    outcome = fly(Mission((13.0, 7.0, 0.0)))
    assert (outcome.kind, outcome.target_distance) == ("landed elsewhere", pytest.approx(13.0))
    assert "13.0 m from the target" in str(outcome)


@pytest.mark.parametrize("finished", [True, False])
def test_failsafe_landing_names_reason_time_and_distance(finished):
    outcome = fly(Mission((1.0, 12.0, 0.0)), finished=finished, status=failsafe(2.0))
    assert (outcome.kind, outcome.failsafe, outcome.failsafe_time) == ("ended in failsafe", "GPS lost", 2.0)
    assert outcome.target_distance == pytest.approx(10.0)
    assert str(outcome).startswith("Ended in failsafe at 4.00 s: GPS lost at 2.00 s, upright on its feet")


def test_failsafe_that_ended_in_air_does_not_count():
    passed = {"failsafe": (T > 2.0) & (T < 3.0), "text": np.where((T > 2.0) & (T < 3.0), "GPS lost", "")}
    assert fly(status=passed).kind == "landed"


def test_failsafe_in_air_at_end_times_out():
    flying = {"landed": T < 1.0, "armed": T >= 1.0}
    outcome = fly(finished=False, status=flying | failsafe(2.0), ground_contact=T < 1.0)
    assert (outcome.kind, outcome.failsafe) == ("timed out", "GPS lost")


def test_turning_over_is_crash_despite_reported_landing():
    outcome = fly(**{"pose.orientation": np.where((T > 3.0)[:, None], ON_ITS_BACK, synthetic_flights.LEVEL)})
    assert (outcome.kind, outcome.time) == ("crashed", pytest.approx(3.01))
    assert outcome.how == "turned over"
    assert outcome.tilt == pytest.approx(np.pi)


def test_hard_touch_is_crash_and_lists_later_accidents():
    turned = np.where((T > 4.2)[:, None], ON_ITS_BACK, synthetic_flights.LEVEL)
    contact = (T < 1.0) | (T >= 4.0)
    fast = np.where(contact, 0.0, -5.3)[:, None] * UP
    outcome = fly(velocity=fast, **{"pose.orientation": turned})
    assert str(outcome).startswith("Crashed at 4.00 s: hit the ground at 5.3 m/s, turned over at 4.21 s; ends at")


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"velocity": np.array([0.6, 0.0, 0.0])}, "moves at 0.6 m/s"),
        ({"pose.orientation": (np.sin(np.radians(20.0)), 0.0, 0.0, np.cos(np.radians(20.0)))}, "tilted by 40°"),
        ({"landed": False}, "does not report a landing"),
        ({"ground_contact": T < 1.0, "pose.position": np.outer(T, UP)}, "not on the ground"),
    ],
)
def test_finished_mission_without_rest_on_its_feet_is_crash(changed, message):
    outcome = fly(**changed)
    assert outcome.kind == "crashed"
    assert message in outcome.how


def test_touch_time_is_first_contact_of_bounce():
    bouncing = (T < 1.0) | ((T >= 3.9) & (T < 3.92)) | (T >= 4.0)
    assert fly(ground_contact=bouncing).time == 3.9


def test_unfinished_mission_times_out_with_its_mode():
    outcome = fly(Mission(None), finished=False)
    assert (outcome.kind, outcome.time) == ("timed out", 4.99)
    assert outcome.how == "mission not finished, in mission (land)"
    unknown = fly(Mission(None), finished=False, status={"mode": "", "phase": ""})
    assert unknown.how == "mission not finished"
    grounded = fly(Mission(None), finished=False, status={"armed": False})
    assert grounded.how == "mission not finished, motors never armed"


@pytest.mark.parametrize("mission", [None, Mission(None, final_phase="land"), Mission(None, is_longer=True)])
def test_flight_without_landing_to_make_is_completed(mission):
    assert fly(mission, finished=False).kind == "completed"


def test_disarming_in_hold_under_operator_is_landing():
    assert fly(finished=False, status={"mode": "hold"}).kind == "landed"


def test_divergence_and_abort_report_their_reason():
    assert str(fly(failure="not finite at t = 5 s", diverged=True)) == "Diverged at 4.99 s: not finite at t = 5 s"
    assert str(fly(failure="ended by SIGINT", finished=False)) == "Aborted at 4.99 s: ended by SIGINT"


def test_flight_without_autopilot_is_completed():
    flight = synthetic_flights.moved([0.0, 1.0, 2.0])
    assert (flight.outcome.kind, flight.landed) == ("completed", False)


def test_mission_target_is_end_of_trajectory():
    flight = lapwing.fly("hover", {"run.duration": 1.0})
    assert flight.mission.is_longer
    assert flight.outcome.kind == "completed"
    target = lapwing.studies.mission.mission_of(
        lapwing.services.scene_resolver.resolve(lapwing.load_scene("hover")), None
    )
    assert target.target[:2] == (0.0, 0.0)
    assert not target.is_longer


@pytest.mark.long
def test_gps_loss_ends_in_failsafe_and_fails_by_default():
    overrides = {"sensors.gps.faults": [{"kind": "dropout", "start": 5.0}]}
    flight = lapwing.fly("delivery_mission", overrides)
    assert flight.outcome.kind == "ended in failsafe"
    assert flight.outcome.failsafe_time > 5.0
    assert flight.outcome.target_distance > 1.0
