"""Events of arming, take-off, landing, flight modes, failsafes and failures, of ground contact and motor saturation."""

import re
from collections.abc import Iterator

from lapwing.messages.topics import TRUTH
from lapwing.services.common import status_texts
from lapwing.services.mavlink import firmware
from lapwing.services.mavlink.events.definition import (
    CRITICAL,
    EMERGENCY,
    WARNING,
    Argument,
    Entry,
    Enumeration,
    Occurrence,
    detector,
    event,
)
from lapwing.services.mavlink.telemetry.power import motor_fractions
from lapwing.services.mavlink.vehicle_cache import VehicleCache

MOTORS = 8  # most that an event can report
MIN_DURATION = 1_000_000_000  # [ns] at a limit before saturation is reported, or off it before saturation ends
_NEAR = 1e-6  # share of the maximum voltage, within which a motor is at a limit
_motors = Argument(
    "motors",
    Enumeration(
        "motors_t", "uint8_t", tuple(Entry(1 << k, f"motor_{k + 1}", str(k + 1)) for k in range(MOTORS)), bits=True
    ),
)

GROUND_CONTACT = event("ground_contact", "contact", "Touches the ground")
GROUND_LEFT = event("ground_left", "contact", "Leaves the ground")
SATURATED = event(
    "motors_saturated", "motors", "Motor {1} at the limit", _motors, level=WARNING,
    description="Zero or full voltage for more than a second: the vehicle cannot follow its setpoint.",
)  # fmt: skip


@detector
class ContactDetector:
    """Detector of changes of the ground contact."""

    def __init__(self) -> None:
        self._contact = True

    def step(self, v: VehicleCache) -> Iterator[Occurrence]:
        """Yield an event if the ground contact changed."""
        truth = v.get(TRUTH)
        if truth is None:
            return
        if truth.ground_contact != self._contact:
            self._contact = truth.ground_contact
            yield (GROUND_CONTACT if truth.ground_contact else GROUND_LEFT), ()


@detector
class SaturationDetector:
    """Detector of motors that stay at a limit in the air."""

    def __init__(self) -> None:
        self._since: int | None = None  # [ns] start of the saturation
        self._last = -MIN_DURATION  # [ns] newest time of saturation
        self._reported = 0  # bits of the reported motors

    def step(self, v: VehicleCache) -> Iterator[Occurrence]:
        """Yield an event for motors that have been at a limit for `MIN_DURATION`, once each."""
        flying = v.status.armed and not v.status.landed
        fractions = motor_fractions(v)[:MOTORS] if flying else []
        saturated = sum(1 << k for k, f in enumerate(fractions) if not _NEAR < f < 1.0 - _NEAR)
        if saturated:
            self._since = v.time_ns if self._since is None else self._since
            self._last = v.time_ns
            if v.time_ns - self._since > MIN_DURATION and saturated & ~self._reported:
                self._reported |= saturated
                yield SATURATED, (saturated,)
        elif v.time_ns - self._last > MIN_DURATION:
            self._since, self._reported = None, 0


ON_GROUND, NO_TAKEOFF, IN_AIR = range(3)
_PLACES = (
    Entry(ON_GROUND, "on_ground", "on the ground"),
    Entry(NO_TAKEOFF, "no_takeoff", "no takeoff after arming"),
    Entry(IN_AIR, "in_air", "in the air"),
)
MODES = tuple(
    dict.fromkeys([*(mode.kind for mode in firmware.get("px4").MODES), "orbit", "goto", "descend", "trajectory"])
)
UNKNOWN = len(MODES)
_MODES = (
    *[Entry(number, kind, kind.replace("_", " ")) for number, kind in enumerate(MODES)],
    Entry(UNKNOWN, "unknown", "another mode"),
)
mode_type = Enumeration("flight_mode_t", "uint8_t", _MODES)

ARMED = event("armed", "arming", "Armed")
DISARMED = event("disarmed", "arming", "Disarmed: {1}", Argument("place", Enumeration("place_t", "uint8_t", _PLACES)))
TAKEOFF = event("takeoff_detected", "contact", "Takeoff detected")
LANDING = event("landing_detected", "contact", "Landing detected")
MODE = event("flight_mode", "mode", "Flight mode: {1}", Argument("mode", mode_type))


def mode_number(mode: str) -> int:
    """Return the number of a mode in events."""
    return MODES.index(mode) if mode in MODES else UNKNOWN


@detector
class FlightDetector:
    """Detector of changes of mode, landed state and arming state."""

    def __init__(self) -> None:
        self._armed, self._landed, self._mode = False, True, ""

    def step(self, v: VehicleCache) -> Iterator[Occurrence]:
        """Yield events for a changed mode, landed state or arming state."""
        s = v.status
        if s.mode != self._mode:
            if self._mode:
                yield MODE, (mode_number(s.mode),)
            self._mode = s.mode
        if s.landed != self._landed:
            self._landed = s.landed
            yield (LANDING if s.landed else TAKEOFF), ()
        if s.armed != self._armed:
            self._armed = s.armed
            if s.armed:
                yield ARMED, ()
            else:
                place = IN_AIR if not s.landed else ON_GROUND if v.flight.takeoff_ns else NO_TAKEOFF
                yield DISARMED, (place,)


_CAUSES = tuple(Entry(k, re.sub(r"\W", "_", reason), reason) for k, reason in enumerate(status_texts.FAILSAFES))
_cause = Argument("cause", Enumeration("failsafe_cause_t", "uint8_t", _CAUSES))

FAILSAFE = event(
    "failsafe", "failsafe", "Failsafe: {1}, now {2}", _cause, Argument("mode", mode_type), level=CRITICAL
)  # fmt: skip
FAILSAFE_OVER = event("failsafe_over", "failsafe", "Failsafe is over")
MOTOR_FAILED = event(
    "motor_failed", "fault", "Motor {1} has failed", Argument("motor", "uint8_t"), level=CRITICAL,
    description="Its thrust is lower than commanded.",
)  # fmt: skip
BATTERY = (
    event("battery_low", "battery", "Low battery", level=WARNING),
    event("battery_critical", "battery", "Critical battery", level=CRITICAL),
    event("battery_emergency", "battery", "Battery nearly empty", level=EMERGENCY),
)


@detector
class FailureDetector:
    """Detector of failures in the autopilot's status."""

    def __init__(self) -> None:
        self._failsafe, self._motor, self._battery = "", 0, 0

    def step(self, v: VehicleCache) -> Iterator[Occurrence]:
        """Yield events for new failures and for the end of a failsafe."""
        s = v.status
        if s.battery_warning != self._battery:
            yield from ((definition, ()) for definition in BATTERY[self._battery : s.battery_warning])
            self._battery = s.battery_warning
        if s.failed_motor != self._motor:
            self._motor = s.failed_motor
            if s.failed_motor:
                yield MOTOR_FAILED, (s.failed_motor,)
        if (reason := s.text if s.failsafe else "") != self._failsafe:
            self._failsafe = reason
            if reason in status_texts.FAILSAFES:
                yield FAILSAFE, (status_texts.FAILSAFES.index(reason), mode_number(s.mode))
            elif not reason:
                yield FAILSAFE_OVER, ()
