"""Key numbers of a flight with their limits."""

from contextlib import suppress
from typing import NamedTuple

import numpy as np

from lapwing.studies.battery_use import WATT_HOUR, battery_use
from lapwing.studies.flight_data import FlightData
from lapwing.studies.flight_events import Event
from lapwing.studies.outcome import HARD, LANDING_RADIUS

TROUBLE = ("failsafe", "fault", "warning", "battery", "slack")  # kinds of events at the top of a report


class KeyNumber(NamedTuple):
    """One number with its unit and limit."""

    label: str
    value: float
    unit: str
    limit: float | None = None  # largest good value, or the smallest if `at_least`
    source: str = ""  # source of the limit
    at_least: bool = False

    @property
    def good(self) -> bool:
        """True if the value is within its limit, or has none."""
        if self.limit is None:
            return True
        return self.value >= self.limit if self.at_least else self.value <= self.limit

    @property
    def comparison(self) -> str:
        """Value relative to the limit as text, e.g. "within 0.35 m (source)"; "" without a limit."""
        if self.limit is None:
            return ""
        sides = ("above", "below") if self.at_least else ("within", "beyond")
        return f"{sides[not self.good]} {self.limit:.3g} {self.unit} ({self.source})"


def key_numbers(flight: FlightData) -> list[KeyNumber]:
    """Return up to five numbers: errors, touch-down, distance from the target, battery or energy."""
    numbers, outcome = [], flight.outcome
    published = flight.origin.scene.get("published", {}).get("rmse", {})
    if flight.rmse:
        axes = ("x", "y", "z")
        limit = float(np.linalg.norm([published[a] for a in axes])) if set(axes) <= set(published) else None
        rmse = float(np.linalg.norm([flight.rmse[axis] for axis in axes]))
        source = flight.origin.scene.get("published", {}).get("source", "published") if limit else ""
        numbers.append(KeyNumber("position error, RMS", rmse, "m", limit, source))
        numbers.append(KeyNumber("largest distance from reference", float(flight.reach[0]), "m"))
    if outcome.touchdown > 0.0:
        numbers.append(KeyNumber("touch-down", outcome.touchdown, "m/s", HARD, "crash"))
    if outcome.target_distance is not None:
        numbers.append(KeyNumber("distance from target", outcome.target_distance, "m", LANDING_RADIUS, "landed there"))
    if use := battery_use(flight):
        limit = None if use.low_threshold is None else 100.0 * use.low_threshold
        left = KeyNumber("battery left at landing", 100.0 * use.charge_left, "%", limit, "warning", at_least=True)
        numbers.append(left._replace(label=f"{left.label}, {use.energy_left:.3g} W h"))
    elif "motor_power" in flight.truth.fields and np.isfinite(flight.truth.motor_power).all():
        with suppress(ValueError):  # the log has no run configuration
            numbers.append(KeyNumber("energy of the motors", flight.energy / WATT_HOUR, "W h"))
    return numbers


def trouble(flight: FlightData) -> list[Event]:
    """Return the adverse events in order of time, including a crash or a divergence."""
    events, outcome = [event for event in flight.events if event.kind in TROUBLE], flight.outcome
    if outcome.kind in ("crashed", "diverged"):
        events.append(Event(outcome.time, outcome.kind, outcome.how))
    return sorted(events, key=lambda event: event.time)
