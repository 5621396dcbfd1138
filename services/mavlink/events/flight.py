"""Events of arming, take-off, landing, flight modes, failsafes and failures."""

from collections.abc import Iterator

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
from lapwing.services.mavlink.vehicle_cache import VehicleCache

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


_CAUSES = tuple(Entry(k, reason.replace(" ", "_"), reason) for k, reason in enumerate(status_texts.FAILSAFES))
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
