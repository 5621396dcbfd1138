"""Failure events: failsafes, motor failures, low battery."""

from collections.abc import Iterator

from lapwing.services.common import status_texts
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
from lapwing.services.mavlink.events.flight import mode_number, mode_type
from lapwing.services.mavlink.vehicle_cache import VehicleCache

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
