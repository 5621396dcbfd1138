"""Events of arming, take-off, landing and flight modes."""

from collections.abc import Iterator

from lapwing.services.mavlink import firmware
from lapwing.services.mavlink.events.definition import Argument, Entry, Enumeration, Occurrence, detector, event
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
