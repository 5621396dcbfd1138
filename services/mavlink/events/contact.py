"""Events from the ground truth and the motor commands: ground contact, motor saturation."""

from collections.abc import Iterator

from lapwing.messages.topics import TRUTH
from lapwing.services.mavlink.events.definition import (
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
