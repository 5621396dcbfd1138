"""Columns of a fleet in a campaign's table: the worst vehicle, and each vehicle by name."""

import math
from collections.abc import Mapping
from typing import Any

from lapwing.flights.flight_data import FlightData
from lapwing.flights.metrics import METRICS
from lapwing.flights.separation import nearest
from lapwing.services.common.schemas.success_criteria import KINDS, Success

NEAREST = "nearest"  # [m] least distance between two vehicles
POSITIONS = ("touchdown.x", "touchdown.y")  # undefined for several vehicles
Row = dict[str, Any]


def columns(vehicles: tuple[str, ...]) -> dict[str, type]:
    """Return the name and type of a fleet's additional columns, such as `left.rmse.x`."""
    success_columns = {f"{name}.success": bool for name in vehicles}
    figures = {
        f"{v}.{name}": str if name == "outcome" else float
        for v in vehicles
        for name in METRICS
        if name != "outcome_text"
    }
    return {NEAREST: float, **success_columns, **figures} if vehicles else {}


def joint_row(flights: Mapping[str, FlightData], by_vehicle: Mapping[str, Row], required: Mapping[str, Success]) -> Row:
    """Return the columns of a run without its drawn parameters.

    Args:
        flights: flights by vehicle name.
        by_vehicle: metrics by vehicle name.
        required: `[success]` by vehicle name.
    """
    result: Row = {name: _worst(name, [row[name] for row in by_vehicle.values()]) for name in METRICS}
    unmet = {name: required[name].unmet(row) for name, row in by_vehicle.items()}
    texts = [
        f"{name}: {by_vehicle[name]['outcome_text']}; not {', not '.join(criteria)}"
        for name, criteria in unmet.items()
        if criteria
    ]
    result |= {"success": not texts, "outcome_text": "; ".join(texts)}
    result[NEAREST] = nearest({name: flight.truth for name, flight in flights.items()}).distance
    for name, row in by_vehicle.items():
        result |= {f"{name}.{key}": value for key, value in row.items() if key != "outcome_text"}
        result[f"{name}.success"] = not unmet[name]
    return result


def _worst(name: str, values: list[Any]) -> Any:
    if name == "outcome":
        return max(values, key=KINDS.index)
    if name == "outcome_text" or name in POSITIONS:
        return "" if name == "outcome_text" else math.nan
    finite = [value for value in values if not math.isnan(value)]
    if not finite:
        return math.nan
    if name == "energy":
        return math.fsum(finite)
    return min(finite) if name.startswith("within_") else max(finite)
