"""Differences of two flights in each quantity of the state, relative to 1 + size."""

from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np

from lapwing.flights.flight_data import FlightData
from lapwing.messages.topics import BATTERY, TRUTH
from lapwing.studies.accuracy.coordinates import matrices

TOPICS = (TRUTH, BATTERY)
BATTERY_FIELDS = ("voltage", "charge")  # of BatteryState, without the current, which jumps if a motor is switched off
STATE_FIELDS = (
    ("position", "position"),
    ("attitude", "orientation"),
    ("velocity", "velocity"),
    ("body rates", "angular_velocity"),
    ("rotor speed", "rotor_speed"),
)  # name, field of the topic
Errors = tuple[str, np.ndarray, np.ndarray]  # name of a quantity, times [s], errors


class Quantity(NamedTuple):
    """Largest error of one quantity of a vehicle's state, relative to 1 + size."""

    vehicle: str
    name: str
    error: float
    time: float  # [s]


def worst_of(quantities: Iterable[Quantity]) -> Quantity:
    """Return the quantity with the largest error."""
    return max(quantities, key=lambda quantity: quantity.error)


def differences_of_all(
    flights: Iterable[FlightData], exact: Iterable[FlightData], spans: list[tuple[float, float]] | None = None
) -> list[Quantity]:
    """Return `differences` of all vehicles."""
    return [q for pair in zip(flights, exact, strict=True) for q in differences(*pair, spans)]


def differences(
    flight: FlightData, exact: FlightData, spans: list[tuple[float, float]] | None = None
) -> list[Quantity]:
    """Return the largest error of each quantity of the state, at the ticks of the first flight.

    Args:
        flight: any flight.
        exact: the flight to compare with, with the same samples or a whole multiple of them.
        spans: intervals [s] to compare, in order, end exclusive; None: all.
    """
    result = []
    for name, times, errors in _errors(flight, exact):
        if spans is not None:
            inside = np.searchsorted(np.ravel(spans), times, side="right") % 2 == 1
            times, errors = times[inside], errors[inside]
        if len(times):
            result.append(Quantity(flight.vehicle, name, float(errors.max()), float(times[errors.argmax()])))
    return result


def _errors(flight: FlightData, exact: FlightData) -> Iterator[Errors]:
    """Yield the errors of each quantity of the state, at the ticks common to both flights."""
    for name, field in STATE_FIELDS:
        a, b = (np.asarray(getattr(each.truth, field)) for each in (flight, exact))
        if field == "orientation":
            a, b = matrices(a), matrices(b)
        yield from _error(name, flight.truth.times, exact.truth.times, a, b)
    if flight.has("battery"):
        for field in BATTERY_FIELDS:
            a, b = (np.asarray(getattr(each.topic("battery"), field)) for each in (flight, exact))
            yield from _error(f"battery {field}", flight.times("battery"), exact.times("battery"), a, b)


def _error(name: str, times: np.ndarray, exact_times: np.ndarray, a: np.ndarray, b: np.ndarray) -> Iterator[Errors]:
    """Yield the errors of one quantity of the state; nothing if the vehicle does not have it."""
    if min(len(times), len(exact_times)) > 1:
        b = b[:: round((times[1] - times[0]) / (exact_times[1] - exact_times[0]))]
    n = min(len(a), len(b))
    a, b = a[:n].reshape(n, -1), b[:n].reshape(n, -1)
    if a.size and np.isfinite(b).all():
        yield name, times[:n], (np.abs(a - b) / (1.0 + np.abs(b))).max(axis=1)
