"""Key numbers of a flight with their limits."""

import math
from contextlib import suppress
from typing import Literal, NamedTuple

import numpy as np

from lapwing.flights.battery_use import WATT_HOUR, battery_use
from lapwing.flights.contacts import HARD
from lapwing.flights.flight_data import FlightData
from lapwing.flights.flight_events import Event
from lapwing.flights.outcome import LANDING_RADIUS, Mark
from lapwing.services.common.schemas.run_schema import published_figures

TROUBLE = ("crash", "failsafe", "fault", "warning", "battery", "slack")  # kinds of events at the top of a report


class KeyNumber(NamedTuple):
    """One number with its unit and limit."""

    label: str
    value: float
    unit: str
    limit: float | None = None  # largest good value, or the smallest if `at_least`
    source: str = ""  # source of the limit
    at_least: bool = False
    worst: float = math.nan  # value above which the number is bad instead of doubtful
    also: str = ""  # after the value and its unit

    @property
    def mark(self) -> Mark | Literal[""]:
        """Judgement of the value by its limit; "" without one."""
        if self.limit is None:
            return ""
        if self.value >= self.limit if self.at_least else self.value <= self.limit:
            return "good"
        return "warn" if self.value <= self.worst else "bad"

    @property
    def text(self) -> str:
        """Value with its unit; a length below 1 cm in millimetres."""
        small = self.unit == "m" and 0.0 < self.value < 0.01
        return f"{1e3 * self.value:.3g} mm" if small else f"{self.value:.3g} {self.unit}{self.also}"

    @property
    def comparison(self) -> str:
        """Value relative to the limit as text, e.g. "within 0.35 m (source)"; "" without a limit."""
        if self.limit is None:
            return ""
        sides = ("above", "below") if self.at_least else ("within", "beyond")
        return f"{sides[self.mark != 'good']} {self.limit:.3g} {self.unit} ({self.source})"


def key_numbers(flight: FlightData) -> list[KeyNumber]:
    """Return up to five numbers: errors, touch-down, distance from the target, battery or energy."""
    numbers, outcome = [], flight.outcome
    figures = published_figures(flight.origin.scene)
    published = figures.get("rmse", {})
    if flight.rmse:
        axes = ("x", "y", "z")
        limit = float(np.linalg.norm([published[a] for a in axes])) if set(axes) <= set(published) else None
        rmse = float(np.linalg.norm([flight.rmse[axis] for axis in axes]))
        source = figures.get("source", "published") if limit else ""
        numbers.append(KeyNumber("position error, RMS", rmse, "m", limit, source))
        numbers.append(KeyNumber("largest distance from reference", float(flight.reach[0]), "m"))
    if outcome.touchdown > 0.0:
        source = "crash" if outcome.commanded is None else f"commanded {outcome.commanded:.2f}"
        limit = outcome.touchdown_limit
        numbers.append(KeyNumber("touch-down", outcome.touchdown, "m/s", limit, source, worst=HARD))
    if outcome.target_distance is not None:
        numbers.append(KeyNumber("distance from target", outcome.target_distance, "m", LANDING_RADIUS, "landed there"))
    if use := battery_use(flight):
        limit = None if use.low_threshold is None else 100.0 * use.low_threshold
        charge, energy = 100.0 * use.charge_left, f", {use.energy_left:.3g} W h"
        numbers.append(KeyNumber("battery left", charge, "%", limit, "warning", at_least=True, also=energy))
    elif _has_power(flight):
        with suppress(ValueError):  # the log has no run configuration
            numbers.append(KeyNumber("energy of the motors", flight.energy / WATT_HOUR, "W h"))
    if outcome.failed:  # nothing of a crash is good
        return [number._replace(limit=None) if number.mark == "good" else number for number in numbers]
    return numbers


def _has_power(flight: FlightData) -> bool:
    """Return True if the log has the power of at least one motor."""
    if "motor_power" not in flight.truth.fields:
        return False
    power = flight.truth.motor_power
    return power.size > 0 and bool(np.isfinite(power).all())


def trouble(flight: FlightData) -> list[Event]:
    """Return the adverse events in order of time, without the ends of failsafes."""
    return [event for event in flight.events if event.kind in TROUBLE and not event.is_end]
