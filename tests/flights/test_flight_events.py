"""Events of synthetic flights."""

import numpy as np
import synthetic_flights

from lapwing.flights.flight_events import refusals
from lapwing.flights.topic_view import TopicView
from lapwing.messages import CommandAck, CommandAcks, header
from lapwing.messages.topic_columns import history
from lapwing.views.report.plots import timeline

TICKS, RATE = 500, 100
T = np.arange(TICKS) / RATE
SCENE = {
    "airframe": {"motor": {"max_voltage": 40.0}},
    "effects": {"rotor_damage": {"rotor": 2, "time": 2.5, "remaining_thrust": 0.3}},
    "sensors": {"gps": {"faults": [{"kind": "dropout", "start": 2.0, "stop": 3.0}]}, "imu": {"preset": "ideal"}},
    "multibody": {"event": [{"time": 9.0, "propeller": 1, "failure": "torn_off"}]},
}


def example_flight(voltage=None):
    """Return a flight: up at 1 s, two motors at the limit for 0.2 s from 2 s on, a failsafe at 3 s, down at 4 s."""
    flying = (T >= 1.0) & (T < 4.0)
    if voltage is None:
        voltage = np.full((TICKS, 4), 20.0)
        voltage[200:220, [0, 2]] = 40.0
    truth = {
        "pose.position": (0.0, 0.0, 0.35),
        "pose.orientation": synthetic_flights.LEVEL,
        "velocity": np.where(flying, -0.5, 0.0)[:, None] * np.array([0.0, 0.0, 1.0]),
        "ground_contact": ~flying,
        "motor_voltage": voltage,
    }
    failsafe = (T >= 3.0) & (T < 4.5)
    status = {
        "armed": flying,
        "landed": ~flying,
        "finished": T > 4.5,
        "mode": np.where(T < 3.0, "mission", "land"),
        "phase": "",
        "failsafe": failsafe,
        "text": np.where(failsafe, "a motor has failed", ""),
        "failed_motor": np.where(T >= 2.8, 2, 0),
        "battery_warning": np.where(T >= 3.5, 1, 0),
    }
    setpoint = {"phase": np.where(T < 2.0, "climb", "hover"), "position": (0.0, 0.0, 0.0), "yaw": 0.0}
    actuators = {"armed": flying, "attitude_reference": (0.0, 0.0, 0.0)}
    return synthetic_flights.flight(
        TICKS, RATE, scene=SCENE, ground_truth=truth, status=status, setpoint=setpoint, actuators=actuators
    )


def test_refused_commands_are_events_with_reasons():
    def answer(result, text=""):
        return CommandAcks(header(0, "world"), (CommandAck("view", 1, result, 0.0, text, 0.0),), ())

    answers = [
        CommandAcks(header(0, "world"), (), ("armed",)),
        answer(CommandAck.ACCEPTED),
        answer(CommandAck.TEMPORARILY_REJECTED, "return: the vehicle does not fly"),
    ]
    times = np.array([0, 100_000_000, 1_100_000_000])
    columns = history(CommandAcks, [each.encode() for each in answers])
    assert refusals(TopicView(times, columns)) == [(1.1, "refused", "return: the vehicle does not fly")]


def test_events_are_listed_in_order():
    assert [tuple(event) for event in example_flight().events] == [
        (0.0, "mode", "mission"),
        (0.0, "phase", "climb"),
        (1.0, "arming", "armed"),
        (1.0, "contact", "leaves the ground"),
        (2.0, "fault", "gps loses its readings until 3 s"),
        (2.0, "phase", "hover"),
        (2.0, "motors", "motors 1, 3 at the limit of 40 V for 0.20 s, 6.7 % of the time in the air"),
        (2.5, "fault", "rotor 2 keeps 30 % of its thrust"),
        (2.8, "fault", "motor 2: failure detected"),
        (3.0, "failsafe", "a motor has failed"),
        (3.0, "mode", "land"),
        (3.5, "battery", "low"),
        (4.0, "arming", "disarmed"),
        (4.0, "contact", "touches the ground at 0.50 m/s"),
        (4.5, "failsafe", "a motor has failed: over"),
    ]


def test_flight_without_autopilot_has_no_events():
    assert synthetic_flights.moved([0.0, 1.0]).events == []


def test_saturation_is_one_event_with_its_share():
    voltage = np.full((TICKS, 4), 20.0)
    voltage[120:130, 0] = voltage[300:330, 2] = 40.0
    (event,) = [event for event in example_flight(voltage).events if event.kind == "motors"]
    assert event.time == 1.2
    assert event.text == "motors 1, 3 at the limit of 40 V for 0.40 s (2 times), 13 % of the time in the air"


def test_saturation_of_all_motors_is_named_once():
    voltage = np.full((TICKS, 4), 20.0)
    voltage[120:130], voltage[130:140] = 40.0, 0.0
    (event,) = [event for event in example_flight(voltage).events if event.kind == "motors"]
    assert event.text == "all motors at the limit of 0 V or 40 V for 0.20 s, 6.7 % of the time in the air"


def test_saturation_of_an_entire_flight_is_100_percent():
    (event,) = [event for event in example_flight(np.full((TICKS, 4), 40.0)).events if event.kind == "motors"]
    assert event.text.endswith(", 100 % of the time in the air")


def test_timeline_shows_each_span_of_saturation_with_its_share():
    voltage = np.full((TICKS, 4), 20.0)
    voltage[120:130, 0] = voltage[300:330, 2] = 40.0
    marks = [mark for mark in timeline.draw(example_flight(voltage)).panels[0].marks if mark.lane == "motor limit"]
    assert [(round(mark.start, 9), round(mark.end, 9), mark.text) for mark in marks] == [
        (1.2, 1.3, "motor 1 at the limit of 40 V for 0.10 s, 3.3 % of the time in the air"),
        (3.0, 3.3, "motor 3 at the limit of 40 V for 0.30 s, 10 % of the time in the air"),
    ]
