"""Page of `lapwing tune`: margins, Bode plots, step responses before and after, and flights."""

import math
from pathlib import Path
from typing import Any

import control
import numpy as np

from lapwing.cosim.complete_file import write_text
from lapwing.studies.report.page import render
from lapwing.studies.report.plot import Level, Line, Panel, Plot
from lapwing.studies.report.sections import Section
from lapwing.studies.report.style import BOUND, FLOWN, QUIET, REFERENCE
from lapwing.studies.tune.console_output import tables
from lapwing.studies.tune.design import DELAY
from lapwing.studies.tune.procedure import GainReview, Tuning
from lapwing.studies.tune.systems import AXES, step, systems

OMEGA = np.geomspace(0.2, 500.0, 1200)  # [rad/s]
LOOP_TITLES = {
    "altitude": "altitude",
    "yaw": "yaw",
    "pitch": "pitch (inner)",
    "x": "x (outer)",
    "x_plant_input": "x, at the plant input",
}
LINE_STYLES = ((REFERENCE, "dash"), (FLOWN, "solid"))  # before, after


def write(path: Path, tuning: Tuning) -> None:
    """Write the page to a file."""
    reviews = (tuning.before, tuning.after)
    loops = [systems(review.parameters, tuning.nominal, tuning.tick, DELAY) for review in reviews]
    sections = [
        Section("bode", "Open loops", _bode(reviews, loops)),
        Section("steps", "Step responses", _steps(reviews, loops)),
    ]
    page = render(
        "tuning.html", title=f"{tuning.scene}: gains", tables=list(tables(tuning)), sections=sections,
        gains=tuning.gains, outcome=_outcome(tuning), failed=bool(tuning.failures),
    )  # fmt: skip
    write_text(path, page)


def _outcome(tuning: Tuning) -> str:
    """Return the outcome of the tuning as text: margins of the loops, and flights of perturbed vehicles."""
    if tuning.failures:
        first, *others = tuning.failures
        return f"The new gains fail: {first}" + (f"; and {len(others)} more" if others else "")
    corners = len(tuning.corners)
    flights = f", and all {corners} flights of perturbed vehicles succeed" if corners else "; no flight was made"
    return f"The new gains pass: all {len(tuning.after.margins)} loops have their margins{flights}"


_BODE = (
    "From the error to the response, with the motors' lag and the sampling delay. Dashed: gains before; solid: new "
    "gains. Dots mark the crossover, where the gain is one; the phase margin is the distance of the phase from -180 "
    "degrees there. Drag an axis to see gains outside 0.001 to 1000 and phases outside -360 to -30 degrees."
)
_STEPS = (
    "Response of the linear model about hover to a unit step, without feed-forward. Above the curves: rise time from "
    "10 to 90 % of the step, and overshoot: how far the response exceeds it."
)


def _bode(reviews: tuple[GainReview, ...], loops: list[dict]) -> Plot:
    panels = []
    for column, (name, title) in enumerate(LOOP_TITLES.items()):
        gain_marks: list[Line | Level] = [Level(1.0, colour=QUIET, dash="solid")]
        phase_marks: list[Line | Level] = [Level(-180.0, colour=BOUND, dash="solid")]
        for review, systems_of, (colour, dash) in zip(reviews, loops, LINE_STYLES, strict=True):
            response = control.frequency_response(systems_of[name], OMEGA)
            phase = np.degrees(np.unwrap(response.phase))
            crossover = review.margins[name].crossover
            at = float(np.clip(crossover, OMEGA[0], OMEGA[-1]))  # for a loop with a crossover
            phase -= 360.0 * math.ceil(np.interp(math.log(at), np.log(OMEGA), phase) / 360.0)  # in (-360, 0] there
            gain_marks.append(Line(OMEGA, np.asarray(response.magnitude), review.name, colour, dash=dash))
            phase_marks.append(Line(OMEGA, phase, review.name, colour, dash=dash))
            crossing = float(np.interp(math.log(at), np.log(OMEGA), phase))
            for marks, y in ((gain_marks, 1.0), (phase_marks, crossing)) if at == crossover else ():
                marks.append(Line(np.array([at]), np.array([y]), colour=colour, marker="circle", joined=False))
        position: dict[str, Any] = {"column": column, "timed": False, "log_x": True}
        label = ("gain", "phase [°]") if column == 0 else ("", "")
        panels.append(Panel(tuple(gain_marks), label[0], title=title, log_y=True, y_range=(1e-3, 1e3), **position))
        panels.append(
            Panel(tuple(phase_marks), label[1], "frequency [rad/s]", row=1, y_range=(-360.0, -30.0), **position)
        )
    return Plot(tuple(panels), _BODE, 5.4, (1.0, 1.0), (1.0,) * len(LOOP_TITLES))


def _steps(reviews: tuple[GainReview, ...], loops: list[dict]) -> Plot:
    panels = []
    for column, (axis, loop) in enumerate(AXES.items()):
        marks: list[Line | Level] = [Level(1.0, colour=QUIET, dash="solid")]
        notes = []
        for review, systems_of, (colour, dash) in zip(reviews, loops, LINE_STYLES, strict=True):
            seconds = 1.5 if axis == "yaw" else 4.0
            inner = f"{loop}_plant_input"  # an outer loop is unstable with its inner one
            if "unstable" in (review.shortfalls.get(loop), review.shortfalls.get(inner)):
                notes.append(f"{review.name}: unstable")
                continue
            result = step(systems_of[loop], seconds)
            notes.append(f"{review.name}: {result.rise:.2g} s, {100.0 * result.overshoot:.0f} % overshoot")
            marks.append(Line(np.asarray(result.time), np.asarray(result.value), review.name, colour, dash=dash))
        label = "response to a unit step" if column == 0 else ""
        top = 1.35 * max([1.0, *(float(mark.y.max()) for mark in marks if isinstance(mark, Line))])  # room for the note
        position: dict[str, Any] = {"column": column, "timed": False, "y_range": (-0.05, top)}
        panels.append(Panel(tuple(marks), label, "time [s]", title=axis, note="\n".join(notes), **position))
    return Plot(tuple(panels), _STEPS, 3.4, widths=(1.0,) * len(AXES))
