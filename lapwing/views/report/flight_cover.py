"""First page of a flight's report on paper."""

from collections.abc import Sequence

from lapwing.flights.flight_data import FlightData
from lapwing.services.common.schemas.run_schema import published_figures
from lapwing.views.report.flight_header import MANY, cut, differences, facts
from lapwing.views.report.key_numbers import KeyNumber, key_numbers
from lapwing.views.report.page import accuracy
from lapwing.views.report.paper import Cover
from lapwing.views.report.sections import labels


def cover(flights: Sequence[FlightData]) -> Cover:
    """Return title, outcomes, table of errors and facts of one flight or of two, with the keys that differ."""
    scenes = [flight.origin.scene for flight in flights]
    names, published = labels(flights), published_figures(scenes[0])
    many = len(flights) > 1
    columns = ["RMSE", *(names if many else ["this flight"])]
    if published.get("rmse"):
        columns.append(published.get("source", "published"))
    rows = [(f"{row.axis} [{row.unit}]", *row.values) for row in accuracy(flights, published.get("rmse", {}))]
    tables = [facts(flight) for flight in flights]
    keys = dict.fromkeys(key for one in tables for key in one)
    values = {key: list(dict.fromkeys(one.get(key, "") for one in tables)) for key in keys}
    differing = differences(*scenes) if len(scenes) == 2 else {}
    listed = [f"{key}: {_side_by_side([cut(value) for value in v])}" for key, v in list(differing.items())[:MANY]]
    if len(differing) > MANY:
        listed.append(f"{len(differing) - MANY} more, in the report as a page")
    return Cover(
        " and ".join(names) if many else flights[0].metadata.get("scene") or names[0],
        " · ".join(dict.fromkeys(filter(None, (s.get("run", {}).get("title", "") for s in scenes)))),
        tuple(
            f"{name}: {flight.outcome}" if many else str(flight.outcome)
            for name, flight in zip(names, flights, strict=True)
        ),
        tuple(columns),
        tuple(rows),
        (
            *((key, _side_by_side(several)) for key, several in values.items()),
            *(("" if k else "scenes differ in", text) for k, text in enumerate(listed)),
        ),
        _numbers(flights, names),
    )


def _numbers(flights: Sequence[FlightData], names: Sequence[str]) -> tuple[tuple[str, KeyNumber], ...]:
    """Return the key numbers of all flights with their labels, those of one kind together."""
    many = len(flights) > 1
    tables = [(name, key_numbers(flight)) for name, flight in zip(names, flights, strict=True)]
    rows = [(number.label, name, number) for name, numbers in tables for number in numbers]
    order = list(dict.fromkeys(label for label, *_ in rows))
    rows.sort(key=lambda row: order.index(row[0]))
    return tuple((f"{name}: {label}" if many else label, number) for label, name, number in rows)


def _side_by_side(values: Sequence[str]) -> str:
    return " | ".join(text or "none" for text in values)
