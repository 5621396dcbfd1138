"""Events of a flight: arming, refused commands, modes, phases, failsafes, faults, slack links, saturation, contact."""

import math
from collections.abc import Iterable, Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np

from lapwing.flights.contacts import Touch
from lapwing.flights.model_validity import validity_warnings
from lapwing.flights.outcome import FlightOutcome
from lapwing.flights.saturation import description, highest_voltage, intervals, percent, saturation
from lapwing.flights.tension import link_tension, pushes
from lapwing.flights.topic_view import TopicView
from lapwing.messages import CommandAck, CommandAcks, header
from lapwing.services.common import ports, status_texts
from lapwing.services.common.event_kinds import KINDS

BATTERY = ("", "low", "critical", "nearly empty")  # by Status.battery_warning
IMU_SELECTION = f"custom_sensor/{ports.IMU_SELECTION}"  # topic of the vote: unit in use, bit mask of failed units
SENSOR_FAULTS = {
    "dropout": "loses its readings",
    "freeze": "freezes at its last reading",
    "bias": "gets an error of {}",
    "spikes": "gets spikes of {}",
    "drift": "starts to drift by {} per second",
    "scale": "starts to read {} times the true value",
    "delay": "starts to read late",
}  # by kind, with its size
UNITS = {
    "gyro": " rad/s",
    "accelerometer": " m/s²",
    "position": " m",
    "velocity": " m/s",
    "pressure": " Pa",
    "field": " T",
    "range": " m",
    "magnetometer": " T",
    "barometer": " Pa",
    "airspeed": " Pa",
}  # by channel, or by a sensor with one channel; fmt: skip
ORDER = tuple(KINDS)  # order of simultaneous events
REFUSALS = (CommandAck.TEMPORARILY_REJECTED, CommandAck.DENIED, CommandAck.UNSUPPORTED, CommandAck.FAILED)
OVER = ": over"  # end of the text of an event that ends a failsafe


class Event(NamedTuple):
    """An event of a flight."""

    time: float  # [s]
    kind: str  # "fault", "failsafe", "crash", "mode", ...; all: lapwing.services.common.event_kinds.KINDS
    text: str

    @property
    def is_end(self) -> bool:
        """True for the end of a failsafe."""
        return self.text.endswith(OVER)


def events(
    truth: TopicView,
    status: TopicView | None,
    setpoint: TopicView | None,
    armed: np.ndarray,
    scene: dict[str, Any],
    contacts: Iterable[Touch],
) -> list[Event]:
    """Return all events of a flight in order of time.

    Args:
        truth: true state.
        status: autopilot status; None without an autopilot, which leaves the planned faults and the phases.
        setpoint: setpoint of the autopilot, if any.
        armed: True where the motors are armed, at the first n times of `truth`, shape (n,).
        scene: tables of the scene.
        contacts: contacts of the vehicle.
    """
    end = float(truth.times[-1]) if len(truth) else 0.0
    result = [Event(time, "fault", text) for time, text, _ in planned_faults(scene) if time <= end]
    if status is not None and len(status):
        result += status_events(status)
        result += _contact_events(truth.times, contacts)
        result += [Event(warning.start, "warning", warning.text) for warning in validity_warnings(truth, scene)]
        highest = highest_voltage(scene)
        if highest is not None and len(armed):
            result += _saturation(truth, armed, highest)
    if setpoint is not None and len(setpoint):
        phases = changes(setpoint.times, setpoint.phase)
        result += [Event(time, "phase", str(phase)) for time, phase in phases if phase]
    return in_order(event._replace(time=round(event.time, 9)) for event in result)  # [ns] resolution of the log


def in_order(events: Iterable[Event]) -> list[Event]:
    """Return events in order of time; simultaneous ones in the order of their kinds."""
    return sorted(events, key=lambda event: (event.time, ORDER.index(event.kind)))


def with_crash(occurrences: Iterable[Event], outcome: FlightOutcome) -> list[Event]:
    """Return the events of a flight with a crash as an event, and the alarms after it marked as such."""
    if not outcome.failed:
        return list(occurrences)
    marked = [
        event._replace(text=f"after the crash: {event.text}")
        if event.time > outcome.time and event.kind in ("fault", "failsafe", "battery")
        else event
        for event in occurrences
    ]
    return in_order([*marked, Event(outcome.time, "crash", outcome.how)])


def slack(bodies: TopicView, lift: TopicView, load: Mapping[str, Any]) -> list[Event]:
    """Return an event for each interval in which a rigid link is in compression, where a cable would be slack.

    Args:
        bodies: poses of the load and the quadrotors.
        lift: thrusts of the quadrotors.
        load: table [cooperative_load] of the scene.
    """
    forces = link_tension(bodies, lift, load)
    result = []
    for k in range(forces.shape[1]):
        for push in pushes(bodies.times[: len(forces)], forces[:, k]):
            text = f"link {k + 1} pushes until {push.stop:.3f} s with up to {push.most:.3g} N: a cable would be slack"
            result.append(Event(round(push.start, 9), "slack", text))
    return sorted(result)


class PlannedFault(NamedTuple):
    """A fault that a scene orders."""

    time: float  # [s]
    text: str
    stop: float = math.inf  # [s]


def planned_faults(scene: dict[str, Any]) -> list[PlannedFault]:
    """Return the planned faults of a scene, in order."""
    result: list[PlannedFault] = []
    damage = scene.get("effects", {}).get("rotor_damage")
    if damage is not None:
        left = damage.get("remaining_thrust", 0.0)
        text = f"rotor {damage.get('rotor')} keeps {100.0 * left:g} % of its thrust"
        result.append(PlannedFault(damage.get("time", 0.0), text))
    for event in scene.get("multibody", {}).get("event", ()):
        text = f"propeller {event['propeller']} becomes {event['failure'].replace('_', ' ')}"
        result.append(PlannedFault(event["time"], text))
    for sensor, table in scene.get("sensors", {}).items():
        for fault in table.get("faults", ()) if isinstance(table, dict) else ():
            result.append(_sensor_fault(sensor, fault))
    return sorted(result)


def _sensor_fault(sensor: str, fault: Mapping[str, Any]) -> PlannedFault:
    """Return a fault of a sensor, in words as "imu (gyro) gets an error of (0.8, 0, 0) rad/s"."""
    channel = fault.get("channel", "all")
    which = "" if channel == "all" else f" ({channel})"
    size, stop = fault.get("size", 0.0), fault.get("stop", math.inf)
    values = f"({', '.join(f'{value:g}' for value in size)})" if isinstance(size, list) else f"{size:g}"
    values += UNITS.get(sensor if channel == "all" else channel, "") if fault["kind"] != "scale" else ""
    until = f" until {stop:g} s" if stop < math.inf else ""
    text = f"{sensor}{which} {SENSOR_FAULTS[fault['kind']].format(values)}{until}"
    return PlannedFault(fault.get("start", 0.0), text, stop)


def changes(t: np.ndarray, values: np.ndarray) -> Iterator[tuple[float, Any]]:
    """Yield time [s] and value at the beginning and at every change."""
    rows = [0, *(np.flatnonzero(values[1:] != values[:-1]) + 1)]
    return ((float(t[k]), values[k]) for k in rows)


def status_events(status: TopicView) -> Iterator[Event]:
    """Yield the events in the autopilot status."""
    t, fields = status.times, set(status.fields)
    if "armed" in fields:
        for time, armed in list(changes(t, status.armed)):
            if armed or time > t[0]:
                yield Event(time, "arming", "armed" if armed else "disarmed")
    if "mode" in fields:
        yield from (Event(time, "mode", str(mode)) for time, mode in changes(t, status.mode) if mode)
    if {"failsafe", "text"} <= fields:
        before = ""
        for time, reason in changes(t, np.where(status.failsafe, status.text.astype(object), "")):
            if reason or before:
                yield Event(time, "failsafe", str(reason) or f"{before}{OVER}")
            before = reason
    if "failed_motor" in fields:
        yield from (
            Event(time, "fault", f"motor {k}: failure detected") for time, k in changes(t, status.failed_motor) if k
        )
    if "battery_warning" in fields:
        for time, level in changes(t, status.battery_warning):
            if level:
                yield Event(time, "battery", BATTERY[min(int(level), len(BATTERY) - 1)])


def imu_failures(selection: TopicView) -> list[Event]:
    """Return the failures of redundant IMUs detected by the autopilot's vote, with the unit in use afterwards."""
    used, failed = np.asarray(selection["values"]).T.astype(int)
    unit_at, before, result = dict(zip(selection.times.tolist(), used, strict=True)), 0, []
    for time, bits in changes(selection.times, failed):
        for unit in range(1, 4):
            if (bits & ~before) >> (unit - 1) & 1:
                text = status_texts.IMU_FAILED.format(unit, unit_at[time])
                result.append(Event(round(time, 9), "fault", text))
        before = bits
    return result


def refusals(answers: TopicView) -> list[Event]:
    """Return the commands that the autopilot has refused, with its reasons, from its acknowledgements."""
    result, nothing = [], len(CommandAcks(header(0, "world")).encode())
    for time_ns, payload in answers.payloads():
        for answer in CommandAcks.decode(payload).acks if len(payload) > nothing else ():
            if answer.result in REFUSALS and answer.text:
                result.append(Event(round(time_ns * 1e-9, 9), "refused", answer.text))
    return result


def _contact_events(t: np.ndarray, contacts: Iterable[Touch]) -> Iterator[Event]:
    for touch in contacts:
        if touch.start > 0:
            yield Event(float(t[touch.start]), "contact", f"touches {touch.where}{touch.circumstances}")
        if touch.stop < len(t) and touch.lands:
            yield Event(float(t[touch.stop]), "contact", f"leaves {touch.body}")


def _saturation(truth: TopicView, armed: np.ndarray, highest: float) -> Iterator[Event]:
    """Yield one event for all times at which a motor is at a limit."""
    result, t = saturation(truth, armed, highest), truth.times
    times = intervals(result.any, t)
    if not times:
        return
    count = f" ({len(times)} times)" if len(times) > 1 else ""
    share = f"{percent(result.share(result.lasted))} of the time in the air"
    where = description(result.low, result.high, highest)
    yield Event(float(t[times[0][0]]), "motors", f"{where} for {result.lasted:.2f} s{count}, {share}")
