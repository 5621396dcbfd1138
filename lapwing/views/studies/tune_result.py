"""Result of `lapwing tune`: margins, errors and flights before and after, Bode plots, step responses."""

import math
from functools import partial
from typing import Any

import control
import numpy as np

from lapwing.flights.tracking import AXES, digits, unit_and_factor
from lapwing.services.autopilot.margins import LOOP_WORDS, Margins
from lapwing.studies.tune import systems
from lapwing.studies.tune.corners import failure
from lapwing.studies.tune.design import DELAY, UNSTABLE
from lapwing.studies.tune.gain_refinement import rmse
from lapwing.studies.tune.identify import LOOPS
from lapwing.studies.tune.procedure import GainReview, Tuning
from lapwing.views.report.plot import Level, Line, Panel, Plot
from lapwing.views.report.style import BOUND, FLOWN, QUIET, REFERENCE
from lapwing.views.studies.study_result import Rows, StudyResult

OMEGA = np.geomspace(0.2, 500.0, 1200)  # [rad/s]
BODE_LOOPS = ("altitude", "yaw", "pitch", "x", "x_plant_input")  # roll and y are similar to pitch and x
LINE_STYLES = ((REFERENCE, "dash"), (FLOWN, "solid"))  # before, after
UNITS = {
    "altitude": "m/s^2 / N",
    "roll": "rad/s^2 / N",
    "pitch": "rad/s^2 / N",
    "yaw": "rad/s^2 / N",
    "spin_up_zero": "s",
    "lag": "s",
}

WORDS = {"spin_up_zero": "spin-up over drag torque", "lag": "lag of the rotors"}

_MARGINS = (
    "Roll and pitch loops follow a tilt, position loops set it; with each other, both are cut at the motors at once. "
    "Crossover: highest frequency at which the loop's gain is 1; the loop follows slower motion. Phase margin: extra "
    "lag that the loop bears. Gain margin and reduction: increase and decrease of the gain that it bears."
)
_ERRORS = (
    "RMSE: root-mean-square error against the reference. Designed: gains from the linear model. Refined: the best of "
    "the gain sets flown."
)
_CORNERS = "The true mass, inertia and thrust differ from the controller's by these shares, all at once."
_MODEL = (
    "Acceleration per force that the controller demands of every rotor. Lag: time constant of the rotors' speed. "
    "Spin-up over drag torque: torque that spins a rotor up, over that of its drag, per unit rate of its speed."
)
_GAINS = (
    "P acts on the error, I on its integral, D on its rate. Altitude, yaw and inner loops output a force per rotor "
    "[N], outer loops a tilt [rad]. The inner roll gains are negative: they act on the tilt to the left."
)


def result(tuning: Tuning) -> StudyResult:
    """Return the result of a tuning."""
    reviews = (tuning.before, tuning.after)
    loops = [systems.systems(review.parameters, tuning.nominal, tuning.tick, DELAY) for review in reviews]
    flown = [_errors(tuning), _corners(tuning)] if tuning.refinement else []
    gains = Rows("Gains", "loop", "P", "I", "D", caption=_GAINS, only="page")
    for name, value in tuning.gains:
        if isinstance(value, tuple):
            gains.add(name, *map(str, value))
    return StudyResult(
        f"{tuning.scene}: gains", _outcome(tuning), "bad" if tuning.failures else "good", (tuning.gains.description,),
        (_margins(tuning), *flown, _model(tuning), gains),
        {"Open loops": partial(_bode, reviews, loops), "Step responses": partial(_steps, reviews, loops)},
    )  # fmt: skip


def _outcome(tuning: Tuning) -> str:
    """Return the outcome of the tuning as text: margins of the loops, and flights of perturbed vehicles."""
    if tuning.failures:
        first, *others = tuning.failures
        return f"The new gains fail: {first}" + (f"; and {len(others)} more" if others else "")
    flights = "; no flight was made"
    if tuning.corners:
        worst, figures = max(tuning.corners.items(), key=lambda item: item[1]["max_distance"])
        error = f"with position errors up to {figures['max_distance']:.2g} m ({worst})"
        flights = f", and all {len(tuning.corners)} flights of perturbed vehicles succeed, {error}"
    return f"The new gains pass: all {len(tuning.after.margins)} loops have their margins{flights}"


def _cells(m: Margins) -> tuple[str, ...]:
    """Return crossover [rad/s], phase margin [deg], gain margins [dB] upwards and downwards."""
    if not 0.0 < m.crossover < math.inf:
        return f"none: gain {'above' if m.crossover else 'below'} 1", "", "", ""
    up, down = (20.0 * math.log10(k) if k > 0.0 else -math.inf for k in (m.gain, m.reduction))
    return f"{m.crossover:.1f}", f"{math.degrees(m.phase):.1f}", f"{up:+.1f}", f"{down:+.1f}"


def _margins(tuning: Tuning) -> Rows:
    heads = ("loop", "gains", "crossover\nrad/s", "phase\nmargin\n°", "gain\nmargin\ndB", "reduction\ndB")
    rows = Rows(f"Margins of the loops before ({tuning.before.name}) and after", *heads, caption=_MARGINS)
    for name in tuning.after.margins:
        for review in (tuning.before, tuning.after):
            failed = review is tuning.after and name in review.shortfalls
            label = "new" if review is tuning.after else "before"
            rows.add(LOOP_WORDS[name], label, *_cells(review.margins[name]), failed=failed)
    return rows


def _errors(tuning: Tuning) -> Rows:
    p = tuning.refinement
    assert p is not None
    title = f"RMSE of {len(p.after)} flights of the scene, designed and refined ({p.gain_sets} gain sets flown)"
    rows = Rows(title, "axis", "designed", "refined", caption=_ERRORS)
    for axis in AXES:
        unit, scale = unit_and_factor(axis)
        rows.add(f"{axis} [{unit}]", digits(scale * rmse(p.before, axis)), digits(scale * rmse(p.after, axis)))
    return rows


def _corners(tuning: Tuning) -> Rows:
    rows = Rows(
        "Flights of vehicles that differ from the controller's model", "vehicle", "max. position error, m", "outcome",
        caption=_CORNERS,
    )  # fmt: skip
    for corner, f in tuning.corners.items():
        rows.add(str(corner), f"{f['max_distance']:.3f}", f["outcome"], failed=bool(failure(f)))
    return rows


def _model(tuning: Tuning) -> Rows:
    if tuning.identification is None:
        rows = Rows("Plant about hover, from the compiled model", "effect", "value", "unit", caption=_MODEL)
        for name, unit in UNITS.items():
            rows.add(WORDS.get(name, name), f"{getattr(tuning.compiled_model, name):.4g}", unit)
        return rows
    rows = Rows(
        "Plant about hover, identified from the log", "effect", "identified", "compiled model", "unit", "fit, %",
        caption=f"{_MODEL} Fit: share of the variation in the log that the identified model explains.",
    )  # fmt: skip
    for name, unit in UNITS.items():
        a, b = getattr(tuning.identification.model, name), getattr(tuning.compiled_model, name)
        fit = f"{tuning.identification.fit[name]:.1f}" if name in LOOPS else ""
        rows.add(WORDS.get(name, name), f"{a:.4g}", f"{b:.4g}", unit, fit)
    return rows


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
    for column, name in enumerate(BODE_LOOPS):
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
        panels.append(
            Panel(tuple(gain_marks), label[0], title=LOOP_WORDS[name], log_y=True, y_range=(1e-3, 1e3), **position)
        )
        panels.append(
            Panel(tuple(phase_marks), label[1], "frequency [rad/s]", row=1, y_range=(-360.0, -30.0), **position)
        )
    return Plot(tuple(panels), _BODE, 5.4, (1.0, 1.0), (1.0,) * len(BODE_LOOPS))


def _steps(reviews: tuple[GainReview, ...], loops: list[dict]) -> Plot:
    panels = []
    for column, (axis, loop) in enumerate(systems.AXES.items()):
        marks: list[Line | Level] = [Level(1.0, colour=QUIET, dash="solid")]
        notes = []
        for review, systems_of, (colour, dash) in zip(reviews, loops, LINE_STYLES, strict=True):
            seconds = 1.5 if axis == "yaw" else 4.0
            inner = f"{loop}_plant_input"  # an outer loop is unstable with its inner one
            if UNSTABLE in (review.shortfalls.get(loop), review.shortfalls.get(inner)):
                notes.append(f"{review.name}: unstable")
                continue
            response = systems.step(systems_of[loop], seconds)
            notes.append(f"{review.name}: {response.rise:.2g} s, {100.0 * response.overshoot:.0f} % overshoot")
            marks.append(Line(np.asarray(response.time), np.asarray(response.value), review.name, colour, dash=dash))
        label = "response to a unit step" if column == 0 else ""
        top = 1.35 * max([1.0, *(float(mark.y.max()) for mark in marks if isinstance(mark, Line))])  # room for the note
        position: dict[str, Any] = {"column": column, "timed": False, "y_range": (-0.05, top)}
        panels.append(Panel(tuple(marks), label, "time [s]", title=axis, note="\n".join(notes), **position))
    return Plot(tuple(panels), _STEPS, 3.4, widths=(1.0,) * len(systems.AXES))
