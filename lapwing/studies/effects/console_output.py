"""Results of the effects study as tables, as JSON and as a plot."""

import math
from pathlib import Path

from matplotlib.figure import Figure
from rich.console import Console

from lapwing.studies import json_file
from lapwing.studies.effects.procedure import Influence, Row, Study
from lapwing.studies.report.matplotlib_figure import plot_style
from lapwing.studies.report.style import BOUND, DPI, FLOWN, WIDTH
from lapwing.studies.terminal import COMPACT, table

MIN_BAR = 1e-6  # [m] length of the shortest bars


def show(console: Console, study: Study) -> None:
    """Print the study."""
    steps = "plant step" if len(study.vehicles) == 1 else f"plant step of all {len(study.vehicles)} vehicles"
    head = f"{study.scene}: {steps}: {study.airborne:.0f} ns hovering, {study.standing:.0f} ns on the ground"
    console.print(head)
    _table(console, "Effects of the scene, and the change without each", study, active=True)
    absent = "not in the scene" if len(study.vehicles) == 1 else "not in all vehicles"
    _table(console, f"Effects {absent}, and the change with each", study, active=False)
    saved = 1.0 - study.smallest_airborne / study.airborne, 1.0 - study.smallest_standing / study.standing
    console.print(
        f"Smallest set within {study.within:g} m: {', '.join(study.smallest) or 'none'} "
        f"(distance {study.distance:.2g} m; "
        f"saves {saved[0]:.0%} of a step hovering, {saved[1]:.0%} on the ground)"
    )
    console.print('Costs after "<" are below the resolution of the measurement.')
    names = ", ".join(row.name for row in study.missing)
    console.print(f"{absent.capitalize()}, influence above {study.within:g} m: {names or 'none'}")


def _table(console: Console, title: str, study: Study, active: bool) -> None:
    if not _sorted_rows(study, active):
        return
    console.print(title)
    heads = ("effect", "hover\n[ns]", "share", "ground\n[ns]", "path\n[m]", "end\n[m]", "energy")
    rows = table(*heads, **COMPACT)
    for row in _sorted_rows(study, active):
        if row.influence is None:
            continue
        ratio = f"{row.airborne / study.airborne:.0%}" if row.airborne > study.noise[0] else ""
        airborne, standing = _cost(row.airborne, study.noise[0]), _cost(row.standing, study.noise[1])
        rows.add_row(row.name.replace(".", "\n  ."), airborne, ratio, standing, *_changes(row.influence))
    console.print(rows)
    for vehicle in study.vehicles if len(study.vehicles) > 1 else ():
        names = [r.name for r in _sorted_rows(study, active) if r.influence and r.influence.vehicle == vehicle]
        if names:
            console.print(f"  largest change for {vehicle}: {', '.join(names)}", soft_wrap=True)
    for row in _sorted_rows(study, active):
        if row.remark:
            console.print(f"  not flown: {row.remark}", soft_wrap=True)


def _cost(difference: float, noise: float) -> str:
    if abs(difference) <= noise:
        return f"< {noise:.2g}"
    return f"{difference:.3g}" if abs(difference) < 999.5 else f"{difference:.0f}"  # without exponent


def _changes(i: Influence) -> tuple[str, str, str]:
    if i.failure:
        return "ends early", "", ""
    return f"{i.trajectory:.2g}", f"{i.final:.2g}", format_percent(i.energy)


def format_percent(ratio: float) -> str:
    """Return a relative change in per cent with two significant digits, without an exponent up to 1000 %."""
    value = 100.0 * ratio
    if not value:
        return "0 %"
    return f"{value:+.0f} %" if 9.95 <= abs(value) < 1e4 else f"{value:+.2g} %"


def _sorted_rows(study: Study, active: bool) -> list[Row]:
    rows = [row for row in study.rows if row.active == active]
    return sorted(rows, key=lambda r: -r.influence.trajectory if r.influence else math.inf)


def write_json(path: Path, study: Study) -> None:
    """Write the study; infinite and unknown values are null."""
    json_file.write_json(path, {**study._asdict(), "missing": [row.name for row in study.missing]})


def plot(path: Path, study: Study) -> None:
    """Plot the influence of every effect over the tolerance, and its cost."""
    rows = [r for r in (*_sorted_rows(study, False)[::-1], *_sorted_rows(study, True)[::-1]) if r.influence]
    names = [row.name if row.active else f"({row.name})" for row in rows]
    with plot_style():
        figure = Figure(figsize=(WIDTH, 1.1 + 0.27 * len(rows)), dpi=DPI, layout="constrained")
        influence, cost = figure.subplots(1, 2, sharey=True)
        distances = [row.influence.trajectory for row in rows if row.influence]
        longest = max([e for e in distances if math.isfinite(e)] + [10.0 * study.within])
        lengths = [min(max(e, MIN_BAR), 3.0 * longest) if e > 0.0 else 0.0 for e in distances]
        colours = [FLOWN if row.active else "#9CC3DD" for row in rows]
        influence.barh(names, lengths, color=colours)
        influence.axvline(study.within, color=BOUND, linewidth=1.2, label=f"tolerance {study.within:g} m")
        influence.set_xscale("log")
        influence.set_xlabel("largest change of the trajectory [m]")
        influence.legend(loc="lower right")
        cost.barh(names, [row.airborne for row in rows], color=colours)
        cost.set_xlabel("cost of a plant step, hovering [ns]")
        for axis in (influence, cost):
            axis.grid(visible=False, axis="y")
            axis.margins(y=0.01)
        figure.suptitle(f"{study.scene}: effects of the scene, and others (in brackets)", fontsize=10)
        figure.savefig(path)
