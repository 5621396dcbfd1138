"""Outcome of synthetic flights: kind, time and circumstances."""

import numpy as np
import pytest
import synthetic_flights

import lapwing
from lapwing.cosim.config.provenance import ENDED
from lapwing.flights.mission import Mission
from lapwing.services.common.status_texts import STOPPED

TICKS, RATE = 500, 100
T = np.arange(TICKS) / RATE
UP = np.array([0.0, 0.0, 1.0])
ON_ITS_BACK = (1.0, 0.0, 0.0, 0.0)


def fly(
    mission=None,
    finished=True,
    landed=True,
    failure="",
    diverged=False,
    status=None,
    scene=None,
    motors=None,
    setpoint=None,
    **truth,
):
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
    status = last | modes | (status or {})
    others = {}
    if motors is not None:
        setpoint = {"phase": "", "position": (1.0, 2.0, 0.35), "yaw": 0.0}
        others["actuators"] = {"armed": motors, "attitude_reference": (0.0, 0.0, 0.0)}
    if setpoint is not None:
        others["setpoint"] = setpoint
    flight = synthetic_flights.flight(
        TICKS, RATE, scene=scene or {}, ground_truth=columns | truth, status=status, **others
    )
    flight.failure, flight.diverged, flight.mission = failure, diverged, mission
    return flight.outcome


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


HOPS = (T % 1.0 >= 0.2) | (T < 1.0)


@pytest.mark.parametrize("finished", [True, False])
def test_vehicle_that_slides_without_takeoff_never_left_the_ground(finished):
    outcome = fly(Mission((13.0, 7.0, 0.0)), finished, ground_contact=HOPS, status={"armed": T < 4.5})
    assert (outcome.kind, outcome.how, outcome.mark) == ("timed out", "never left the ground", "warn")


def test_vehicle_that_is_only_armed_and_disarmed_never_took_off():
    status = {"armed": (T > 1.0) & (T < 3.0), "mode": "hold"}
    outcome = fly(ground_contact=True, velocity=0.0, status=status)
    assert (outcome.kind, outcome.mark) == ("completed", "warn")
    assert str(outcome) == "Completed at 4.99 s: never left the ground: no mission"
    lost = fly(ground_contact=True, velocity=0.0, status=status | failsafe(2.0, "link lost"))
    assert str(lost).startswith("Ended in failsafe at 4.99 s: link lost at 2.00 s, never left the ground")


def test_blockers_of_arming_are_reasons_to_stay_on_the_ground():
    blockers = np.empty(TICKS, object)
    blockers[:] = [("the vehicle is not level", "the battery is low: 3%")] * TICKS
    status = {"armed": False, "arming_blockers": blockers}
    outcome = fly(Mission(None), finished=False, ground_contact=True, status=status)
    assert outcome.how.endswith("never armed: the vehicle is not level; the battery is low: 3%")


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
    assert outcome.how == "turned over in the air"
    assert outcome.tilt == pytest.approx(np.pi)


def test_hard_touch_is_crash_and_lists_later_accidents():
    turned = np.where((T > 4.2)[:, None], ON_ITS_BACK, synthetic_flights.LEVEL)
    contact = (T < 1.0) | (T >= 4.0)
    fast = np.where(contact, 0.0, -5.3)[:, None] * UP
    outcome = fly(velocity=fast, **{"pose.orientation": turned})
    text = "Crashed at 4.00 s: hit the ground at 5.30 m/s; tipped over 0.21 s later; ends tilted by 180° at"
    assert str(outcome).startswith(text)


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
    holding = {"mode": "mission", "phase": "item 2 of 2: hold until told otherwise at home"}
    held = fly(Mission(None), finished=False, status=holding)
    assert str(held) == "Completed at 4.99 s: held its position until the end, as planned"
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


def turned_over(start):
    return {"pose.orientation": np.where((start <= T)[:, None], ON_ITS_BACK, synthetic_flights.LEVEL)}


def test_divergence_names_accident_before_it():
    damage = {"effects": {"rotor_damage": {"rotor": 2, "time": 2.0}}}
    outcome = fly(failure="not finite at t = 5 s", diverged=True, scene=damage, **turned_over(3.0))
    first = "rotor 2 keeps 0 % of its thrust at 2.00 s; turned over in the air 1.00 s later"
    assert str(outcome) == f"Diverged at 4.99 s: {first}; not finite at t = 5 s"
    assert [cause.time for cause in outcome.causes] == [2.0, 3.0, 4.99]


@pytest.mark.parametrize(
    ("fault", "text"),
    [
        ({"kind": "dropout"}, "imu loses its readings"),
        ({"kind": "freeze", "channel": "gyro"}, "imu (gyro) freezes at its last reading"),
        ({"kind": "bias", "channel": "gyro", "size": [0.8, 0, 0]}, "imu (gyro) gets an error of (0.8, 0, 0) rad/s"),
        ({"kind": "spikes", "size": 3.0}, "imu gets spikes of 3"),
        ({"kind": "drift", "size": 0.1}, "imu starts to drift by 0.1 per second"),
        ({"kind": "scale", "size": -1.0}, "imu starts to read -1 times the true value"),
        ({"kind": "delay", "samples": 9}, "imu starts to read late"),
    ],
)
def test_crash_names_sensor_fault_in_words(fault, text):
    outcome = fly(scene={"sensors": {"imu": {"faults": [fault | {"start": 2.0}]}}}, **turned_over(3.0))
    assert str(outcome).startswith(f"Crashed at 3.00 s: {text} at 2.00 s; turned over in the air 1.00 s later")


def test_first_failsafe_is_cause_and_others_follow():
    texts = np.select([T < 2.0, T < 2.5], ["", "the battery is low"], "the battery is critical")
    outcome = fly(status={"failsafe": T >= 2.0, "text": texts}, **turned_over(3.0))
    assert [cause.text for cause in outcome.causes] == ["failsafe (the battery is low)", "turned over in the air"]


def test_motors_that_stop_in_flight_are_first_cause():
    falling = np.where(((T >= 3.0) & (T < 4.0))[:, None], -9.81 * (T - 3.0)[:, None] * UP, 0.0)
    outcome = fly(velocity=falling, motors=(T >= 1.0) & (T < 3.0))
    assert [cause.text for cause in outcome.causes[:2]] == [
        "the autopilot stopped the motors in flight, 0.3 m above ground, at 0.00 m/s",
        "hit the ground at 9.71 m/s",
    ]
    assert fly(velocity=falling, motors=(T >= 1.0) & (T < 4.5)).causes[0].text.startswith("hit the ground")


def test_failsafe_that_stops_the_motors_is_named_once_as_first_cause():
    falling = np.where(((T >= 3.0) & (T < 4.0))[:, None], -9.81 * (T - 3.0)[:, None] * UP, 0.0)
    outcome = fly(
        velocity=falling, motors=(T >= 1.0) & (T < 3.0), status=failsafe(3.0, "the vehicle has left the fence")
    )
    first, second, *_ = [cause.text for cause in outcome.causes]
    assert first.startswith("the vehicle has left the fence: the autopilot stopped the motors in flight, 0.3 m above ")
    assert second == "hit the ground at 9.71 m/s"
    assert outcome.consequences == ()
    stopped = fly(velocity=falling, motors=(T >= 1.0) & (T < 3.0), status=failsafe(3.0, STOPPED))
    assert stopped.causes[0].text.startswith(f"{STOPPED}, 0.3 m above ground")


def test_fault_before_a_failsafe_is_its_cause():
    fault = {"kind": "dropout", "start": 1.5}
    outcome = fly(Mission((1.0, 12.0, 0.0)), status=failsafe(2.0), scene={"sensors": {"gps": {"faults": [fault]}}})
    assert str(outcome).startswith(
        "Ended in failsafe at 4.00 s: gps loses its readings at 1.50 s; GPS lost at 2.00 s, "
    )


def test_setpoint_that_leads_into_the_ground_is_the_cause():
    fast = {"velocity": np.where(((T >= 3.0) & (T < 4.0))[:, None], -4.1 * UP, 0.0)}
    setpoint = {"phase": "", "position": (1.0, 2.0, 0.35), "yaw": 0.0, "velocity": -4.0 * UP}
    assert fly(setpoint=setpoint, **fast).how == (
        "the setpoint led into the ground: hit the ground at 4.10 m/s (commanded 4.00, limit 2)"
    )


def test_bad_rest_after_landing_is_dated_by_touchdown_and_is_a_cause():
    outcome = fly(landed=False)
    assert outcome.time == 4.0
    assert outcome.causes[-1].text.startswith("not at rest on its feet after the mission")
    assert str(outcome).startswith("Crashed at 4.00 s: touched the ground at 0.40 m/s; not at rest")


def test_end_by_user_counts_only_before_landing():
    assert fly(finished=False, failure=ENDED, status={"mode": "hold"}).kind == "landed"
    assert fly(finished=False, failure=ENDED, status={"mode": "mission"}).kind == "aborted"
    assert fly(finished=False, failure="the log is incomplete", status={"mode": "hold"}).kind == "aborted"


def test_flight_without_autopilot_is_completed():
    flight = synthetic_flights.moved([0.0, 1.0, 2.0])
    assert (flight.outcome.kind, flight.landed) == ("completed", False)


def test_mission_target_is_end_of_trajectory():
    flight = lapwing.fly("hover", {"run.duration": 1.0})
    assert flight.mission.is_longer
    assert flight.outcome.kind == "completed"
    target = lapwing.flights.mission.mission_of(
        lapwing.services.scene_resolver.resolve(lapwing.load_scene("hover")), None
    )
    assert target.target[:2] == (0.0, 0.0)
    assert not target.is_longer
