"""Work-precision comparison of Lapwing with other simulators (docs/explanation/accuracy.md).

    python -m benchmarks.accuracy

Simulators that are not installed (extra `bench`) are skipped.
"""

from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from benchmarks import _simulators
from benchmarks._command import command_line
from lapwing.studies.accuracy.coordinates import of_state
from lapwing.studies.accuracy.integrate import solver_methods
from lapwing.studies.accuracy.problem import Problem
from lapwing.studies.accuracy.reference import DOP853, dop853
from lapwing.studies.accuracy.systems import gyrostat, problems
from lapwing.studies.accuracy.work_precision import Point, measure
from lapwing.views.report.matplotlib_figure import plot_style
from lapwing.views.report.style import DPI
from lapwing.views.studies.accuracy_plot import COLOURS, MARKERS

CASES = ("free_rigid_body", "heavy_top", "gyrostat_steady")
LEVELS = [10.0**-k for k in range(2, 11)]
TEN_HOURS = 600.0  # [min] of the gyrostat
SEED_STEPS = 60_000  # number of steps of 0.01 min
TEN_HOUR_LEVELS = (1e-2, 1e-4, 1e-6, 1e-8)
TEN_HOUR_CASES = {
    "rotors blocked": gyrostat.BLOCKED,
    "rotors spinning": gyrostat.SPINNING,
    "friction": gyrostat.FRICTION,
    "friction and feedback": gyrostat.FEEDBACK,
}
PICTURE = Path(__file__).parents[1] / "docs/pictures/accuracy_other_simulators.png"


def best(points: list[Point], level: float) -> Point | None:
    """Return the fastest point with at most this error."""
    return min((p for p in points if p.error <= level), key=lambda p: p.time, default=None)


def simulator(point: Point) -> str:
    """Return the simulator of a point: "Lapwing", or the first word of its method's name."""
    return point.method.split()[0] if " " in point.method else "Lapwing"


def table(title: str, points: list[Point]) -> None:
    others = [name for name in dict.fromkeys(map(simulator, points)) if name != "Lapwing"]
    print(
        f"\n{title}\n{'error':>6} {'Lapwing [ms]':>24} "
        + "".join(f"{name + ' [ms]':>30} {'ratio':>6}" for name in others)
    )
    for level in LEVELS:
        ours = best([p for p in points if simulator(p) == "Lapwing"], level)
        if ours is None:
            continue
        line = f"{level:6.0e} {ours.method + f' {1e3 * ours.time:.3g}':>24} "
        for name in others:
            other = best([p for p in points if simulator(p) == name], level)
            if other is None:
                line += f"{'not reached':>30} {'':>6}"
            else:
                method = other.method.partition(" ")[2]
                line += f"{method + f' {1e3 * other.time:.3g}':>30} {other.time / ours.time:6.1f}"
        print(line)


def draw(results: dict[str, list[Point]]) -> None:
    """Plot the fastest method of each simulator at every error."""
    with plot_style():
        figure = Figure(figsize=(13.0, 4.6), layout="constrained")
        all_axes = figure.subplots(1, len(results), sharey=True)
        names = list(dict.fromkeys(simulator(p) for points in results.values() for p in points))
        for axes, (title, points) in zip(all_axes, results.items(), strict=True):
            for index, name in enumerate(names):
                reached = [best([p for p in points if simulator(p) == name], level) for level in LEVELS]
                points = [(level, p) for level, p in zip(LEVELS, reached, strict=True) if p]
                axes.plot(
                    [1e3 * p.time for _, p in points], [level for level, _ in points],
                    color=COLOURS[index], marker=MARKERS[index], markersize=4.5, label=name,
                )  # fmt: skip
            axes.set_xscale("log")
            axes.set_yscale("log")
            axes.set_title(title)
            axes.set_xlabel("wall time [ms]")
        all_axes[0].set_ylabel("error met, relative to 1 + size [-]")
        figure.legend(*all_axes[0].get_legend_handles_labels(), loc="outside right center")
        figure.savefig(PICTURE, dpi=DPI, metadata={"Software": None})


def ten_hours() -> None:
    """Print times and errors over ten hours of gyrostat: of 60 000 steps of RKMK4, and of the cheapest runs."""
    print(f"\nten hours of gyrostat: method, ms of compiled time (error)\n{'case':24}{'60 000 steps':>32}"
          + "".join(f"{level:>32.0e}" for level in TEN_HOUR_LEVELS))  # fmt: skip
    for name, p in TEN_HOUR_CASES.items():
        points = measure(ten_hour_problem(name, p))
        of_seed = [p for p in points if p.method == "rkmk4" and abs(p.setting - TEN_HOURS / SEED_STEPS) < 1e-9]
        cells: list[Point | None] = [*of_seed] or [None]  # none if fewer steps reach round-off
        cells += [best(points, level) for level in TEN_HOUR_LEVELS]
        print(f"{name:24}" + "".join(f"{text(p):>32}" for p in cells))


def ten_hour_problem(name: str, p: Any) -> Problem:
    methods = solver_methods(p, gyrostat.START, TEN_HOURS, SEED_STEPS // 32)  # 60 000 is one of the numbers of steps
    return Problem(
        f"gyrostat, {name}", TEN_HOURS, methods,
        lambda: dop853(lambda t, y: gyrostat.right_hand_side(p, t, y), of_state(gyrostat.START), TEN_HOURS),
        DOP853, unit="min",
    )  # fmt: skip


def text(point: Point | None) -> str:
    return f"{point.method} {1e3 * point.time:.2g} ({point.error:.0e})" if point else "-"


def main() -> None:
    from importlib.metadata import version

    others = _simulators.installed()
    print("versions: " + ", ".join(f"{p.NAME} {version(p.MODULE)}" for p in others))
    result: dict[str, list[Point]] = {}
    for case in CASES:
        problem = problems()[case]
        points = measure(problem)
        for module in others:
            points += measure(problem._replace(methods=module.methods(case), invariants={}))
        result[problem.title] = points
        table(f"{problem.title}, {problem.duration:g} {problem.unit}", points)
    draw(result)
    ten_hours()


if __name__ == "__main__":
    command_line(main)
