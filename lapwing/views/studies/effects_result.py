"""Result of the effects study."""

import math
from functools import partial

import numpy as np

from lapwing.studies.effects.procedure import Influence, Row, Study
from lapwing.views.report.plot import Line, Panel, Plot, Stretch
from lapwing.views.report.style import BOUND, FLOWN, QUIET
from lapwing.views.studies.study_result import Rows, StudyResult

OMITTED = "#9CC3DD"  # colour of effects that can be omitted
SHORTEST = 1e-6  # [m] least change with a bar


def result(study: Study) -> StudyResult:
    """Return the result of a study of effects."""
    fleet = len(study.vehicles) > 1
    absent = "not in all vehicles" if fleet else "not in the scene"
    hovering = _share(study.airborne - study.smallest_airborne, study.airborne, study.noise[0]) or "nothing"
    standing = _share(study.standing - study.smallest_standing, study.standing, study.noise[1]) or "nothing"
    steps = f"plant step of all {len(study.vehicles)} vehicles" if fleet else "plant step"
    rows = [(active, row) for active in (True, False) for row in _sorted_rows(study, active)]
    notes = [
        "Path: largest distance from the flight of the scene at equal times. End: distance of the final positions. "
        "Share: of the step hovering.",
        'Costs after "<" are below the resolution of the measurement.',
    ]
    for vehicle in study.vehicles if fleet else ():
        for active in (True, False):
            names = [r.name for a, r in rows if a == active and r.influence and r.influence.vehicle == vehicle]
            if names:
                notes.append(f"largest change for {vehicle}: {', '.join(names)}")
    notes += [f"not flown: {row.remark}" for _, row in rows if row.remark]
    missing = ", ".join(row.name for row in study.missing) or "none"
    verdict = f"smallest set of effects within {study.within:g} m: {', '.join(study.smallest) or 'none'}"
    savings = [f"distance {study.distance:.2g} m; saves {hovering} of a step hovering, {standing} on the ground"]
    studied = {row.name for active, row in rows if active and "." not in row.name}
    if studied and studied <= set(study.smallest):
        verdict = f"each studied effect of the scene is needed within {study.within:g} m: {', '.join(sorted(studied))}"
        savings = []
    return StudyResult(
        study.scene,
        verdict,
        "",
        (
            *savings,
            f"{absent.capitalize()}, influence above {study.within:g} m: {missing}",
            f"{steps}: {study.airborne:.0f} ns hovering, {study.standing:.0f} ns on the ground",
        ),
        (
            _table("Effects of the scene, and the change without each", study, active=True),
            _table(f"Effects {absent}, and the change with each", study, active=False),
        ),
        {"Influence of effects": partial(_plot, study)},
        tuple(notes),
        data={**study._asdict(), "missing": [row.name for row in study.missing]},
    )


def _table(title: str, study: Study, active: bool) -> Rows:
    rows = Rows(title, "effect", "hover\n[ns]", "share", "ground\n[ns]", "path\n[m]", "end\n[m]", "energy")
    for row in _sorted_rows(study, active):
        if row.influence is None:
            continue
        ratio = _share(row.airborne, study.airborne, study.noise[0])
        airborne, standing = _cost(row.airborne, study.noise[0]), _cost(row.standing, study.noise[1])
        rows.add(row.name.replace(".", "\n  ."), airborne, ratio, standing, *_changes(row.influence))
    return rows


def _share(difference: float, whole: float, noise: float) -> str:
    """Return the share of a cost; "" below the resolution of the measurement."""
    return f"{100.0 * difference / whole:.0f} %" if difference > noise else ""


def _cost(difference: float, noise: float) -> str:
    if difference <= noise:  # without gravity or thrust the vehicle falls, and a step may take longer
        return f"< {noise:.2g}"
    return f"{difference:.3g}" if difference < 999.5 else f"{difference:.0f}"  # without exponent


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


def _plot(study: Study) -> Plot:
    """Plot the influence of every effect with the tolerance; its cost is beside its name."""
    rows = sorted((r for r in study.rows if r.influence), key=lambda r: -r.influence.trajectory if r.influence else 0.0)
    distances = [row.influence.trajectory for row in rows if row.influence]
    longest = 3.0 * max([e for e in distances if math.isfinite(e)] + [10.0 * study.within])
    start = 0.5 * SHORTEST
    marks: list[Stretch | Line] = []
    for row, distance in zip(rows, distances, strict=True):
        name = f"{row.name if row.active else f'({row.name})'}, {_cost(row.airborne, study.noise[0])} ns"
        if row.influence and row.influence.failure:
            name += ", ends early"
        elif distance < SHORTEST:
            name += f", < {SHORTEST:.0e} m" if distance else ", 0 m"
        if row.active:
            colour = FLOWN if row.name.split(".")[0] in study.smallest else OMITTED
        else:
            colour = BOUND if row in study.missing else QUIET
        end = min(distance, longest) if distance >= SHORTEST else start
        marks.append(Stretch(name, start, end, "", colour))
    corner = np.full(2, start), np.full(2, -0.5)  # place of lines without length, for the legend
    legend = {"needed": FLOWN, "can be omitted": OMITTED, "(missing)": BOUND, "(not needed)": QUIET}
    drawn = {mark.colour for mark in marks}
    marks += [Line(*corner, name, colour) for name, colour in legend.items() if colour in drawn]
    tolerance = np.full(2, study.within)
    marks.append(Line(tolerance, np.array([-0.5, len(rows) - 0.5]), f"tolerance {study.within:g} m", BOUND))
    label = "largest change of the trajectory [m]; beside the names: cost of a plant step, hovering"
    panel = Panel(tuple(marks), "", label, timed=False, log_x=True, x_range=(start, longest))
    return Plot((panel,), "", 1.4 + 0.27 * len(rows))
