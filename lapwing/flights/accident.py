"""Causes of an accident, the first cause first, and the alarms that follow it.

Causes are looked for in the true state, not in alarms: an alarm may come after the accident, or from none.
"""

import math
from collections.abc import Iterator
from contextlib import suppress
from typing import Any, Protocol

import numpy as np

from lapwing.flights.contacts import GROUND, HARD, Touch, lowest_point, slope_at
from lapwing.flights.flight_events import Event, planned_faults, status_events
from lapwing.flights.outcome import (
    HARDER,
    NEVER_LEFT,
    UPRIGHT,
    UPSIDE,
    FlightOutcome,
    Incident,
    commanded_descent,
    first_accident,
)
from lapwing.flights.rotation_arrays import conjugate, from_xyzw, product, rotation_vector
from lapwing.flights.saturation import highest_voltage, saturation
from lapwing.flights.topic_view import TopicView
from lapwing.services.common import status_texts

BEFORE = 30.0  # [s] before an accident in which a failure that is over can be its cause
ACTING = 0.5  # [s] before an accident in which a failsafe cannot have led to it
BEFORE_TURNING = 10.0  # [s] before the vehicle turns over in which an obstacle can be the cause
STATUS_DELAY = 0.05  # [s] between a stop of the motors and the status with its reason
FALLING = 0.3  # [s] without contact after the motors stopped: a fall from more than 0.4 m
STANDING = 1.0  # [s] before the vehicle turns over in which it touched the ground: it tips over
ON_PATH = 1.0  # [m] from the setpoint, within which a vehicle is where it shall be
OFF_PATH = 5.0  # [m] from the setpoint, beyond which it has been driven off
WINDY, DRIVEN = 8.0, "driven off by wind"  # [m/s]; start of a cause, of which a wrong estimate is a result
SLIPPING = 2.0  # [s] of contact with a roof before the vehicle leaves it: it has not landed there
GENTLE = 0.3  # [m/s] slower contacts with obstacles are no hits
WRONG_POSITION, WRONG_ATTITUDE = 5.0, math.radians(20.0)  # [m], [rad] errors of the estimate that lose a vehicle
IDLE = 0.2  # share of the weight
EMPTY = 0.05  # charge below which a battery is empty
WEAK, LEAST_COMMAND, WEAK_TIME = 0.5, 0.25, 0.2  # share of the thrust; share of the mean thrust; [s]
OSCILLATION, CROSSINGS, GROWTH = 3.0, 6, 1.5  # [s] before the accident; sign changes; growth of the amplitude
RUNAWAY_DEG = (20.0, 20.0, 60.0)  # errors of roll, pitch and yaw that the control has lost
SWING = 0.1  # share of the largest rate below which a change of sign is no swing
FAST = 1.0  # [rad/s] rate at which an oscillation has begun
SATURATED = 0.5  # share of the last second with a motor at a limit
STEEP = math.tan(math.radians(3.0))
ALARMS = ("fault", "failsafe", "battery")  # kinds of events


class Flight(Protocol):
    """Flight whose accident is explained; see `FlightData`."""

    @property
    def truth(self) -> TopicView: ...  # noqa: D102
    @property
    def contacts(self) -> list[Touch]: ...  # noqa: D102
    @property
    def origin(self) -> Any: ...  # noqa: D102
    @property
    def config(self) -> Any: ...  # noqa: D102
    @property
    def armed(self) -> np.ndarray: ...  # noqa: D102
    def has(self, topic: str) -> bool: ...  # noqa: D102
    def topic(self, name: str) -> TopicView: ...  # noqa: D102


def with_causes(outcome: FlightOutcome, flight: Flight) -> FlightOutcome:
    """Return the outcome of a crash with its causes and consequences, and that of a lost mission with its causes."""
    if not flight.has("status"):
        return outcome
    in_failsafe = outcome.kind == "ended in failsafe" and outcome.failsafe_time is not None
    if not (outcome.failed or outcome.kind == "timed out" or in_failsafe):
        return _with_hits(outcome, flight)
    end = outcome.failsafe_time if in_failsafe else outcome.time
    assert end is not None
    sign = _first_sign(flight, outcome)
    chain = _accident(flight, sign) if outcome.failed and math.isfinite(sign) else []
    begin = min([end, *(incident.time for incident in chain)])
    first = [touch for touch in flight.contacts if _start(flight, touch) == begin]
    hit = any(touch.body != GROUND for touch in first)
    causes = list(_failures(flight, begin))
    if hit and _off_path(flight, begin)[0] < ON_PATH:  # it is on its way: only lost thrust has to do with it
        causes = [cause for cause in causes if "rotor" in cause.text or "propeller" in cause.text]
    if outcome.how.startswith(NEVER_LEFT):
        causes += [] if causes else _lack_of_thrust(flight)
    elif not (hit or causes or in_failsafe or any(_as_commanded(flight, touch) for touch in first)):
        causes += _loss_of_control(flight, begin)
    if not (hit or any(cause.text.startswith(DRIVEN) for cause in causes)):
        # a wrong estimate may also be a result of lost control
        causes += _wrong_estimate(flight, begin)
    causes.sort(key=lambda incident: incident.time)
    how = _text([*causes, *chain], end if outcome.kind == "diverged" else begin)
    how = "; ".join(filter(None, (outcome.how, how) if outcome.kind == "timed out" else (how, outcome.how)))
    alarms = [
        Incident(event.time, _alarm(event.kind, event.text))
        for event in status_events(flight.topic("status"))
        if outcome.failed and event.kind in ALARMS and event.time > begin and not event.is_end
    ]
    time = begin if outcome.kind == "crashed" else outcome.time
    last = [Incident(end, outcome.how)] if outcome.failed and outcome.how else []
    result = outcome._replace(time=time, how=how, causes=(*causes, *chain, *last), consequences=tuple(sorted(alarms)))
    return result if outcome.failed else _with_hits(result, flight)


def _first_sign(flight: Flight, outcome: FlightOutcome) -> float:
    """Return the time [s] of the first certain sign of an accident; of the last touch-down if that ended badly."""
    if math.isfinite(time := first_accident(flight.truth, flight.contacts)) or outcome.kind == "diverged":
        return time
    return max(
        (_start(flight, touch) for touch in flight.contacts if touch.lands and touch.start), default=outcome.time
    )


def _with_hits(outcome: FlightOutcome, flight: Flight) -> FlightOutcome:
    """Return the outcome of a flight that was not lost, with the first hit of each obstacle and vehicle."""
    hits: dict[str, Incident] = {}
    for touch in flight.contacts:
        leaves = touch.stop < len(flight.truth)
        brief = float(flight.truth.times[touch.stop - 1]) - _start(flight, touch) < SLIPPING
        slipped = bool(touch.lands and touch.face and brief and leaves)
        if (not touch.lands or slipped) and touch.speed > GENTLE:
            text = f"slipped off {touch.where}{touch.circumstances}" if slipped else _hit(flight, touch)
            hits.setdefault(touch.body, Incident(_start(flight, touch), text))
    if not hits:
        return outcome
    how = ", ".join(filter(None, (outcome.how, *(f"{text}, at {time:.2f} s" for time, text in hits.values()))))
    return outcome._replace(how=how, causes=(*outcome.causes, *hits.values()))


def _alarm(kind: str, text: str) -> str:
    if kind == "fault":
        return text.replace(": failure detected", " failure alarm")
    return f"battery {text}" if kind == "battery" else f"failsafe ({text})"


def _start(flight: Flight, touch: Touch) -> float:
    return round(float(flight.truth.times[touch.start]), 9)  # [ns] resolution of the log


def _text(incidents: list[Incident], reference: float) -> str:
    """Return incidents in order: the first with its time unless that is the reference, the others after it."""
    parts, first = [], None
    for time, text in incidents:
        if first is None:
            comma = "," if text.endswith("m/s") else ""
            parts.append(text if time == reference else f"{text}{comma} at {time:.2f} s")
            first = time
        else:
            comma = "," if any(map(str.isdigit, text)) else ""  # between two figures
            parts.append(text if time - first < 0.005 else f"{text}{comma} {time - first:.2f} s later")
    return "; ".join(parts)


def _accident(flight: Flight, end: float) -> list[Incident]:
    """Return the contacts of an accident and the turning over, in order; `end` [s] is its first certain sign."""
    truth, t = flight.truth, flight.truth.times
    turned = np.flatnonzero(truth.tilt_cosine < UPSIDE)[:1].tolist()
    over = round(float(t[turned[0]]), 9) if turned else math.inf
    result: list[Incident] = []
    bodies, tips = set(), False
    for touch in flight.contacts:
        start, last = _start(flight, touch), float(t[min(touch.stop, len(t) - 1)])
        leads = start <= end and (end - start < BEFORE_TURNING if not touch.lands else end - last < STANDING)
        if (touch.start > 0 or touch.passes) and (leads or (start > end - BEFORE_TURNING and touch.crashes)):
            result += [Incident(start, _hit(flight, touch))] * (touch.body not in bodies)
            bodies.add(touch.body)
        tips = tips or (touch.lands and start <= over and over - last < STANDING)
    if turned:
        where = _on_slope(flight, turned[0]) if tips else ""
        in_air = not result or min(result).time > over
        result.append(Incident(over, f"tipped over{where}" if tips else f"turned over{' in the air' * in_air}"))
    return sorted(result)


def _on_slope(flight: Flight, row: int) -> str:
    """Return the slope of the ground below the vehicle as text; "" if it is level."""
    slope = slope_at(flight.origin.scene, flight.truth.position[row])
    return f" on a slope of {math.degrees(math.atan(slope)):.0f}°" if slope > STEEP else ""


def _hit(flight: Flight, touch: Touch) -> str:
    if not touch.lands:
        return f"hit {touch.where}{touch.circumstances}"
    if touch.speed <= HARD:
        slope = "" if touch.face else _on_slope(flight, touch.start)
        return f"touched {touch.where}{slope}{touch.circumstances}"
    commanded = _commanded(flight, touch)
    text = f"hit {touch.where}{touch.circumstances}"
    if _as_commanded(flight, touch):
        return f"the setpoint led into {touch.body}: {text} (commanded {commanded:.2f}, limit {HARD:g})"
    if not commanded or flight.truth.tilt_cosine[touch.start - 1] < UPRIGHT:
        return text
    return f"hard landing: {text} (commanded {commanded:.2f}, limit {HARD:g})"


def _commanded(flight: Flight, touch: Touch) -> float:
    """Return the commanded descent speed [m/s] just before a touch; 0 if it is unknown."""
    setpoint = flight.topic("setpoint") if flight.has("setpoint") else None
    return commanded_descent(setpoint, float(flight.truth.times[touch.start])) or 0.0


def _as_commanded(flight: Flight, touch: Touch) -> bool:
    """Return True for a touch that is too fast, and hardly faster than commanded."""
    return touch.lands and HARD < touch.speed <= HARDER * _commanded(flight, touch)


def _off_path(flight: Flight, time: float) -> tuple[float, float]:
    """Return the distance [m] from the setpoint at a time [s], and since when it exceeds OFF_PATH; NaN without one."""
    if not flight.has("setpoint"):
        return math.nan, math.nan
    setpoint, truth = flight.topic("setpoint"), flight.truth
    n = min(int(np.searchsorted(truth.times, time)) + 1, len(truth), len(setpoint))
    distance = np.linalg.norm(setpoint.position[:n] - truth.position[:n], axis=1)
    near = np.flatnonzero(distance <= OFF_PATH)
    return float(distance[-1]), float(truth.times[min(int(near[-1]) + 1 if len(near) else 0, n - 1)])


def _failures(flight: Flight, time: float) -> Iterator[Incident]:
    """Yield failures up to `time` [s]: planned faults, stopped motors, lost thrust, low charge, a failsafe."""
    for start, text, stop in planned_faults(flight.origin.scene):
        if start <= time < stop + BEFORE:
            yield Incident(start, text)
    failsafes = [event for event in status_events(flight.topic("status")) if event.kind == "failsafe"]
    stopped = list(_stopped_motors(flight, time, failsafes))
    yield from stopped
    yield from _weak_rotors(flight, time)
    yield from _empty_battery(flight, time)
    last = stopped[0].time - STATUS_DELAY if stopped else time - ACTING
    for event in failsafes:
        if time - BEFORE < event.time < last and not event.is_end:
            yield Incident(event.time, f"failsafe ({event.text})")
            return  # later ones follow from the first


def _stopped_motors(flight: Flight, time: float, failsafes: list[Event]) -> Iterator[Incident]:
    """Yield the last time up to `time` [s] at which the motors were stopped so high that the vehicle fell, and why."""
    truth, armed = flight.truth, flight.armed
    stops = np.flatnonzero(armed[:-1] & ~armed[1:]) + 1
    stops = stops[truth.times[stops] <= time]
    if len(stops):
        start = float(truth.times[stops[-1]])
        falls = (truth.times >= start) & (truth.times < start + FALLING)
        if not truth.ground_contact[falls].any():
            height = lowest_point(truth, flight.origin.scene)(stops[-1])
            speed = np.linalg.norm(truth.velocity[stops[-1]])
            reasons = [event.text for event in failsafes if abs(event.time - start) < STATUS_DELAY]
            text = "the autopilot stopped the motors in flight"
            if reasons:
                text = reasons[0] if reasons[0] == status_texts.STOPPED else f"{reasons[0]}: {text}"
            yield Incident(start, f"{text}, {height:.1f} m above ground, at {speed:.2f} m/s")


def _weak_rotors(flight: Flight, time: float) -> Iterator[Incident]:
    """Yield the rotors that give less than half of the commanded thrust."""
    truth = flight.truth
    if not flight.has("actuators") or "rotor_thrust" not in truth.fields:
        return
    command = flight.topic("actuators").thrust
    n = min(len(truth), len(command), int(np.searchsorted(truth.times, time, side="right")))
    if n < 2 or not command.size or command.shape[1:] != truth.rotor_thrust.shape[1:]:
        return
    asked = command[:n] > LEAST_COMMAND * command[:n].mean()
    weak = asked & (truth.rotor_thrust[:n] < WEAK * command[:n])
    rows = max(1, round(WEAK_TIME / float(truth.times[1] - truth.times[0])))
    starts: dict[int, float] = {}
    for k in range(weak.shape[1]):
        lasting = np.flatnonzero(np.convolve(weak[:, k], np.ones(rows), "valid") > rows - 0.5)
        if len(lasting):
            starts[k + 1] = float(truth.times[lasting[0]])
    planned = flight.origin.scene.get("effects", {}).get("rotor_damage")
    if len(starts) == weak.shape[1] > 1:
        off = flight.has("battery") and (flight.topic("battery").voltage <= 0.0).any()
        cause = "the battery switched off: " if off else ""
        yield Incident(min(starts.values()), f"{cause}all rotors lost thrust")
    elif planned is None:
        yield from (Incident(start, f"rotor {k} lost its thrust") for k, start in starts.items())


def _empty_battery(flight: Flight, time: float) -> Iterator[Incident]:
    if flight.has("battery"):
        battery = flight.topic("battery")
        low = np.flatnonzero((battery.percentage < EMPTY) & (battery.times <= time))
        if len(low):
            yield Incident(float(battery.times[low[0]]), f"the battery was empty: charge below {100.0 * EMPTY:.0f} %")


def _runaway(flight: Flight, stop: int) -> list[Incident]:
    """Return the first angle that left its reference and stayed away until before row `stop` of the truth."""
    if not flight.has("actuators"):
        return []
    truth, reference = flight.truth, flight.topic("actuators").attitude_reference[:stop]
    n, found = len(reference), []
    error = abs(np.angle(np.exp(1j * (truth.attitude[:n] - reference))))
    for name, limit, values in zip(("roll", "pitch", "yaw"), RUNAWAY_DEG, np.degrees(error).T, strict=True):
        within = np.flatnonzero(values <= limit)
        if n and within.size and within[-1] + 1 < n:
            time = float(truth.times[within[-1] + 1])
            found.append(Incident(time, f"the attitude control lost {name}: over {limit:g}° from its reference"))
    return sorted(found)[:1]


def _lack_of_thrust(flight: Flight) -> Iterator[Incident]:
    """Yield the largest thrust of a vehicle that has not left the ground although its motors were armed."""
    truth, armed = flight.truth, flight.armed
    if "rotor_thrust" not in truth.fields or not armed.any():
        return
    thrust = truth.rotor_thrust[: len(armed)].sum(axis=1)
    with suppress(ValueError, KeyError, AttributeError):  # no run configuration, or another autopilot
        airframe = flight.config.services["autopilot"].parameters.airframe
        weight, row = airframe.mass * airframe.gravity, int(thrust.argmax())
        text = f"the rotors gave at most {thrust[row]:.0f} N"
        if thrust[row] < IDLE * weight:
            text = "no take-off was commanded"
        elif thrust[row] < weight:
            text += f", and the vehicle weighs {weight:.0f} N"
        else:
            text += f", too little for the vehicle of {weight:.0f} N and its load"
        yield Incident(float(truth.times[row]), text)


def _wrong_estimate(flight: Flight, time: float) -> Iterator[Incident]:
    if not flight.has("estimate"):
        return
    estimate, truth = flight.topic("estimate"), flight.truth
    k = np.searchsorted(truth.times, estimate.times[estimate.times <= time]).clip(0, len(truth) - 1)
    m = len(k)
    turn = product(conjugate(from_xyzw(estimate.orientation[:m])), from_xyzw(truth.orientation[k]))
    angle = np.linalg.norm(rotation_vector(turn), axis=1)
    distance = np.linalg.norm(estimate.position[:m] - truth.position[k], axis=1)
    armed = np.flatnonzero(flight.armed)  # before, the estimator may not have started
    flying = estimate.times[:m] >= (truth.times[armed[0]] if len(armed) else math.inf)
    for wrong, text in (
        (distance > WRONG_POSITION, "the estimated position was wrong by {0:.0f} m"),
        (angle > WRONG_ATTITUDE, "the estimated attitude was wrong by {1:.0f}°"),
        (~np.isfinite(distance + angle), "the estimate was not finite"),
    ):
        if wrong[-1:].any() and flying[-1]:
            right = np.flatnonzero(~wrong)
            first = int(right[-1]) + 1 if len(right) else 0
            if estimate.times[first] > truth.times[armed[-1]]:
                continue  # the motors had stopped
            yield Incident(float(estimate.times[first]), text.format(distance[-1], math.degrees(angle[-1])))


def _loss_of_control(flight: Flight, time: float) -> Iterator[Incident]:
    """Yield signs of lost control before `time` [s] without a failure: wind, attitude, motors at their limits."""
    truth, scene = flight.truth, flight.origin.scene
    stop = int(np.searchsorted(truth.times, time, side="right"))
    last = slice(int(np.searchsorted(truth.times, time - OSCILLATION)), stop)
    if stop < 2 or truth.ground_contact[last].all():
        return
    wind = float(np.linalg.norm(truth.wind[last], axis=1).mean()) if "wind" in truth.fields else 0.0
    distance, since = _off_path(flight, time)
    if distance > OFF_PATH:
        by = f"{DRIVEN} of {wind:.1f} m/s" if wind > WINDY else "lost its path"
        yield Incident(since, f"{by} ({distance:.0f} m off at last)")
    elif wind > WINDY:
        yield Incident(time, f"wind of {wind:.1f} m/s")
    rates = truth.angular_velocity[last, :2]
    axis = int(np.ptp(rates, axis=0).argmax())
    third = max(1, len(rates) // 3)
    grows = np.ptp(rates[-third:, axis]) > max(GROWTH * np.ptp(rates[:third, axis]), 2.0 * FAST)
    swings = rates[abs(rates[:, axis]) > SWING * abs(rates[:, axis]).max(), axis]
    crossings = int((np.diff(np.sign(swings)) != 0).sum())
    away = _runaway(flight, stop)
    if crossings >= CROSSINGS and grows:
        name, began = ("roll", "pitch")[axis], int(np.argmax(abs(rates[:, axis]) > FAST))
        start = float(truth.times[last][began])
        yield Incident(start, f"the attitude control was unstable: {name} oscillated more and more")
        yield from (incident for incident in away if incident.time < start)
    elif away:
        yield from away
    elif (highest := highest_voltage(scene)) is not None and len(flight.armed):
        at_limit = saturation(truth, flight.armed, highest).any[max(0, stop - third) : stop]
        if len(at_limit) and at_limit.mean() > SATURATED:
            yield Incident(time, "the motors were at their limits")
