"""Results of the accuracy study as tables and as JSON."""

from pathlib import Path

from rich.box import SIMPLE
from rich.console import Console
from rich.table import Table

from lapwing.studies import json_file
from lapwing.studies.accuracy.error_budget import ErrorSource
from lapwing.studies.accuracy.problem import Problem
from lapwing.studies.accuracy.round_off import RoundOff
from lapwing.studies.accuracy.work_precision import Point, pareto_points

LEVELS = [10.0**-k for k in range(2, 11, 2)]  # errors for which the cheapest points are printed


def setting(point: Point, unit: str) -> str:
    """Format the step or tolerance of a point."""
    return f"tol {point.setting:.0e}" if point.unit == "tol" else f"{point.setting:.3g} {unit}"


def sentence(point: Point, unit: str) -> str:
    """Format a point as one line."""
    setting_name = "tolerance" if point.unit == "tol" else "step"
    text = f"{point.setting:.0e}" if point.unit == "tol" else f"{point.setting:.6g} {unit}"
    cost = "" if point.evaluations is None else f", {point.evaluations} evaluations"
    return f"{point.method}, {setting_name} {text}: error {point.error:.1e}, {1e3 * point.time:.3g} ms{cost}"


def show(
    console: Console, problem: Problem, points: list[Point], selected: Point | None, rounding: RoundOff | None = None
) -> None:
    """Print the cheapest points of each method at a few errors, and the round-off error."""
    console.print(f"{problem.title}, {problem.duration:g} {problem.unit}; reference: {problem.source}", highlight=False)
    table = Table(box=None, pad_edge=False, collapse_padding=True)
    table.add_column("method (order)\n    step")
    drifts = ["drift of\n" + name.replace(" ", "\n") for name in _drifts(points)]
    for name in ("error", "time\n[ms]", "evaluations", *drifts):
        table.add_column(name, justify="right", no_wrap=True)
    previous = None
    for point in pareto_points(points, LEVELS):
        if point.method != previous:
            table.add_row(f"{point.method} ({point.order})")
        table.add_row(
            f"    {setting(point, problem.unit)}", f"{point.error:.1e}", f"{1e3 * point.time:.3g}",
            "" if point.evaluations is None else str(point.evaluations),
            *(f"{point.drift[n]:.0e}" for n in _drifts(points)),
        )  # fmt: skip
        previous = point.method
    console.print(table)
    if rounding is not None:
        text = (
            f"round-off: {rounding.error:.1e}, against {rounding.steps} equal steps of {rounding.method} "
            "in extended precision"
        )
        console.print(text, highlight=False)
    if selected is not None:
        console.print(f"cheapest: {sentence(selected, problem.unit)}", highlight=False)


def _drifts(points: list[Point]) -> list[str]:
    return list(points[0].drift) if points else []


def show_error_sources(console: Console, parts: list[ErrorSource], cost: tuple[float, float] | None) -> None:
    """Print the error sources of a flight, and the cost of a plant step [ns]: hovering, on the ground."""
    console.print("Error sources of the flight, in closed loop without noise (90th percentile over the ticks):")
    table = Table(box=SIMPLE, pad_edge=False)
    table.add_column("source", no_wrap=True)
    table.add_column("setting", no_wrap=True)
    table.add_column("position (m)", justify="right")
    table.add_column("attitude (rad)", justify="right")
    table.add_column("largest (m)", justify="right")
    previous = None
    for part in parts:
        source = part.source if part.source != previous else ""
        errors = (part.position, part.attitude, part.largest_position)
        table.add_row(source, part.label, *(f"{error:.1e}" for error in errors))
        previous = part.source
    console.print(table)
    if cost:
        air, ground = cost
        console.print(f"A plant step takes {air:.0f} ns hovering, {ground:.0f} ns in contact.", highlight=False)


def write_json(
    path: Path,
    target: str,
    problem: Problem,
    points: list[Point],
    selected: Point | None,
    parts: list[ErrorSource],
    rounding: RoundOff | None = None,
    cost: tuple[float, float] | None = None,
) -> None:
    """Write all points, and for a scene its error sources and the cost [ns] of a plant step."""
    data = {
        "target": target,
        "title": problem.title,
        "duration": problem.duration,
        "time_unit": problem.unit,
        "reference": problem.source,
        "points": points,
        "cheapest": selected,
        "round_off": rounding,
        "error_sources": parts,
        "step_ns": dict(zip(("hovering", "in contact"), cost, strict=True)) if cost else None,
    }
    json_file.write_json(path, data)
