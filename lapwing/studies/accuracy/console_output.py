"""Results of the accuracy study as tables."""

from rich.box import SIMPLE
from rich.console import Console

from lapwing.studies.accuracy.error_budget import ErrorSource
from lapwing.studies.accuracy.problem import Problem
from lapwing.studies.accuracy.round_off import RoundOff
from lapwing.studies.accuracy.work_precision import Point, pareto_points
from lapwing.studies.terminal import table

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
    drifts = ["drift of\n" + name.replace(" ", "\n") for name in _drifts(points)]
    heads = ("method (order)\n    step", "error", "time\n[ms]", "evaluations", *drifts)
    rows = table(*heads, box=None, pad_edge=False, collapse_padding=True)
    previous = None
    for point in pareto_points(points, LEVELS):
        if point.method != previous:
            rows.add_row(f"{point.method} ({point.order})")
        rows.add_row(
            f"    {setting(point, problem.unit)}", f"{point.error:.1e}", f"{1e3 * point.time:.3g}",
            "" if point.evaluations is None else str(point.evaluations),
            *(f"{point.drift[n]:.0e}" for n in _drifts(points)),
        )  # fmt: skip
        previous = point.method
    console.print(rows)
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
    heads = ("source", "setting", "position (m)", "attitude (rad)", "largest (m)")
    rows = table(*heads, box=SIMPLE, pad_edge=False)
    rows.columns[1].justify = "left"
    previous = None
    for part in parts:
        source = part.source if part.source != previous else ""
        errors = (part.position, part.attitude, part.largest_position)
        rows.add_row(source, part.label, *(f"{error:.1e}" for error in errors))
        previous = part.source
    console.print(rows)
    if cost:
        air, ground = cost
        console.print(f"A plant step takes {air:.0f} ns hovering, {ground:.0f} ns in contact.", highlight=False)
