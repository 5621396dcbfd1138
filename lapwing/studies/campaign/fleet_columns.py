"""A run of a fleet in a campaign's table: the worst of its vehicles in the columns of a run, and each by its name."""

import math
from collections.abc import Mapping
from typing import Any

from lapwing.services.common.success_criteria import Success
from lapwing.studies.flight_data import FlightData
from lapwing.studies.metrics import METRICS
from lapwing.studies.outcome import KINDS
from lapwing.studies.separation import nearest

NEAREST = "nearest"  # [m] least distance between two vehicles
PLACES = ("touchdown.x", "touchdown.y")  # which of several has no meaning
Row = dict[str, Any]


def columns(vehicles: tuple[str, ...]) -> dict[str, type]:
    """Return the name and type of a fleet's additional columns, such as `left.rmse.x`."""
    each = {f"{name}.success": bool for name in vehicles}
    figures = {
        f"{v}.{name}": str if name == "outcome" else float
        for v in vehicles
        for name in METRICS
        if name != "outcome_text"
    }
    return {NEAREST: float, **each, **figures} if vehicles else {}


def joint_row(flights: Mapping[str, FlightData], of_each: Mapping[str, Row], required: Mapping[str, Success]) -> Row:
    """Return the columns of a run without its drawn parameters.

    Args:
        flights: flights by vehicle name.
        of_each: metrics by vehicle name.
        required: `[success]` by vehicle name.
    """
    result: Row = {name: _worst(name, [row[name] for row in of_each.values()]) for name in METRICS}
    unmet = {name: required[name].unmet(row) for name, row in of_each.items()}
    texts = [
        f"{name}: {of_each[name]['outcome_text']}; not {', not '.join(missed)}"
        for name, missed in unmet.items()
        if missed
    ]
    result |= {"success": not texts, "outcome_text": "; ".join(texts)}
    result[NEAREST] = nearest({name: flight.truth for name, flight in flights.items()}).distance
    for name, row in of_each.items():
        result |= {f"{name}.{key}": value for key, value in row.items() if key != "outcome_text"}
        result[f"{name}.success"] = not unmet[name]
    return result


def _worst(name: str, values: list[Any]) -> Any:
    if name == "outcome":
        return max(values, key=KINDS.index)
    if name == "outcome_text" or name in PLACES:
        return "" if name == "outcome_text" else math.nan
    known = [value for value in values if not math.isnan(value)]
    if not known:
        return math.nan
    if name == "energy":
        return math.fsum(known)
    return min(known) if name.startswith("within_") else max(known)
