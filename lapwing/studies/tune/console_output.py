"""Results of `lapwing tune` as tables."""

import math
from collections.abc import Iterator

from rich.console import Console

from lapwing.services.autopilot.margins import Margins
from lapwing.studies.terminal import COMPACT, table
from lapwing.studies.tracking import AXES, unit_and_factor
from lapwing.studies.tune.corners import failure
from lapwing.studies.tune.gain_refinement import rmse
from lapwing.studies.tune.identify import LOOPS
from lapwing.studies.tune.procedure import Tuning

UNITS = {
    "altitude": "m/s^2 / N",
    "roll": "rad/s^2 / N",
    "pitch": "rad/s^2 / N",
    "yaw": "rad/s^2 / N",
    "spin_up_zero": "s",
    "lag": "s",
}

_MARGINS = (
    "Inner loops (roll, pitch) follow a tilt, outer ones (x, y) a position; at the plant input, both act at once. "
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
    "Spin-up zero: torque that spins a rotor up, over that of its drag, per unit rate of its speed."
)


class Rows:
    """Table of texts with title, column heads and rows; the first cell of a row is its name."""

    def __init__(self, title: str, *heads: str, caption: str = ""):
        self.title, self.heads, self.caption = title, heads, caption
        self.rows: list[tuple[str, ...]] = []
        self.failed: set[int] = set()  # indices of rows with a failure

    def add(self, *cells: str, failed: bool = False) -> None:
        """Add a row."""
        if failed:
            self.failed.add(len(self.rows))
        self.rows.append(cells)


def tables(tuning: Tuning) -> Iterator[Rows]:
    """Yield all tables of the study, the result first."""
    yield _margins(tuning)
    if tuning.refinement:
        yield _errors(tuning)
        yield _corners(tuning)
    yield _model(tuning)


def show(console: Console, tuning: Tuning) -> None:
    """Print the tables, failures in red."""
    for rows in tables(tuning):
        shown = table(*rows.heads, title=rows.title, **COMPACT)
        for k, row in enumerate(rows.rows):
            shown.add_row(*row, style="bold red" if k in rows.failed else None)
        console.print(shown)
    for text in tuning.failures:
        console.print(f"new gains fail: {text}", style="bold red", soft_wrap=True)


def cells(m: Margins) -> tuple[str, ...]:
    """Return crossover [rad/s], phase margin [deg], gain margins [dB] upwards and downwards."""
    if not 0.0 < m.crossover < math.inf:
        return f"none: gain {'above' if m.crossover else 'below'} 1", "", "", ""
    up, down = (20.0 * math.log10(k) if k > 0.0 else -math.inf for k in (m.gain, m.reduction))
    return f"{m.crossover:.1f}", f"{math.degrees(m.phase):.1f}", f"{up:+.1f}", f"{down:+.1f}"


def _margins(tuning: Tuning) -> Rows:
    heads = ("loop", "gains", "crossover,\nrad/s", "phase\nmargin, °", "gain\nmargin, dB", "reduction,\ndB")
    rows = Rows("Margins of the loops before and after", *heads, caption=_MARGINS)
    for name in tuning.after.margins:
        for review in (tuning.before, tuning.after):
            failed = review is tuning.after and name in review.shortfalls
            rows.add(name, review.name, *cells(review.margins[name]), failed=failed)
    return rows


def _errors(tuning: Tuning) -> Rows:
    p = tuning.refinement
    assert p is not None
    title = f"RMSE of {len(p.after)} flights of the scene, designed and refined ({p.candidates} gain sets flown)"
    rows = Rows(title, "axis", "designed", "refined", caption=_ERRORS)
    for axis in AXES:
        unit, scale = unit_and_factor(axis)
        rows.add(f"{axis} [{unit}]", f"{scale * rmse(p.before, axis):.4f}", f"{scale * rmse(p.after, axis):.4f}")
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
            rows.add(name, f"{getattr(tuning.compiled_model, name):.4g}", unit)
        return rows
    rows = Rows(
        "Plant about hover, identified from the log", "effect", "identified", "compiled model", "unit", "fit, %",
        caption=f"{_MODEL} Fit: share of the variation in the log that the identified model explains.",
    )  # fmt: skip
    for name, unit in UNITS.items():
        a, b = getattr(tuning.identification.model, name), getattr(tuning.compiled_model, name)
        fit = f"{tuning.identification.fit[name]:.1f}" if name in LOOPS else ""
        rows.add(name, f"{a:.4g}", f"{b:.4g}", unit, fit)
    return rows
