"""The page of `lapwing tune`: margins, Bode plots and step responses before and after, and what was flown."""

import math
from pathlib import Path

import control
import numpy as np
from matplotlib.figure import Figure

from studies.report.page import Section, png, render
from studies.report.style import BOUND, FLOWN, REFERENCE, WIDTH, styled
from studies.tune.design import DELAY
from studies.tune.show import tables
from studies.tune.study import Judged, Tuned
from studies.tune.systems import AXES, step, systems

OMEGA = np.geomspace(0.2, 500.0, 1200)  # [rad/s]
SHOWN = {
    "altitude": "altitude",
    "yaw": "yaw",
    "pitch": "pitch (inner)",
    "x": "x (outer)",
    "x_plant_input": "x, loop broken at the plant input",
}
LOOKS = ((REFERENCE, (0, (4, 3))), (FLOWN, "-"))  # of before and after


def write(path: Path, found: Tuned) -> None:
    """Write the page."""
    both = (found.before, found.after)
    loops = [systems(j.parameters, found.assumed, found.tick, DELAY) for j in both]
    with styled():
        sections = [
            Section("bode", "Open loops", png(_bode(both, loops)), _BODE),
            Section("steps", "Steps of the setpoint", png(_steps(both, loops)), _STEPS),
        ]
    page = render(
        "tuning.html", title=f"{found.scene}: gains", tables=list(tables(found)), sections=sections, gains=found.gains
    )
    path.write_text(page, encoding="utf-8")


_BODE = (
    "From the error to what answers it, with the motors' lag and the delay of sampling. Dots: where the gain is one; "
    "the phase margin is what is left above -180 degrees there."
)
_STEPS = "Linear, about hover, nothing fed forward: what feedback alone makes of a unit step."


def _bode(both: tuple[Judged, ...], loops: list[dict]) -> Figure:
    figure = Figure(figsize=(WIDTH, 5.2), layout="constrained")
    panels = figure.subplots(2, len(SHOWN), sharex=True, sharey="row")
    for column, (name, title) in enumerate(SHOWN.items()):
        top, bottom = panels[:, column]
        for judged, systems_of, (colour, dashes) in zip(both, loops, LOOKS, strict=True):
            response = control.frequency_response(systems_of[name], OMEGA)
            size, phase = response.magnitude, np.degrees(np.unwrap(response.phase))
            at = judged.margins[name].crossover
            phase -= 360.0 * math.ceil(np.interp(math.log(at), np.log(OMEGA), phase) / 360.0)  # in (-360, 0] there
            top.loglog(OMEGA, size, color=colour, linestyle=dashes, label=judged.name)
            bottom.semilogx(OMEGA, phase, color=colour, linestyle=dashes)
            top.plot(at, 1.0, "o", color=colour, markersize=4)
            bottom.plot(at, np.interp(math.log(at), np.log(OMEGA), phase), "o", color=colour, markersize=4)
        top.axhline(1.0, color="#666666", linewidth=0.8)
        bottom.axhline(-180.0, color=BOUND, linewidth=1.0)
        top.set_title(title)
        top.set_ylim(1e-3, 1e3)
        bottom.set_ylim(-360.0, -30.0)
        bottom.set_yticks(np.arange(-360, -59, 60))
        bottom.set_xlabel("frequency [rad/s]")
    panels[0, 0].set_ylabel("gain")
    panels[1, 0].set_ylabel("phase [deg]")
    figure.legend(*panels[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=2)
    return figure


def _steps(both: tuple[Judged, ...], loops: list[dict]) -> Figure:
    figure = Figure(figsize=(WIDTH, 3.0), layout="constrained")
    panels = figure.subplots(1, len(AXES), sharey=True)
    for panel, (axis, loop) in zip(panels, AXES.items(), strict=True):
        for judged, systems_of, (colour, dashes) in zip(both, loops, LOOKS, strict=True):
            seconds = 1.5 if axis == "yaw" else 4.0
            if loop in judged.shortfalls and judged.shortfalls[loop] == "unstable":
                continue
            found = step(systems_of[loop], seconds)
            said = f"{judged.name}: {found.rise:.2g} s, {100.0 * found.overshoot:.0f} % over"
            panel.plot(found.time, found.value, color=colour, linestyle=dashes, label=said)
        panel.axhline(1.0, color="#666666", linewidth=0.8)
        panel.set_title(axis)
        panel.set_xlabel("time [s]")
        panel.legend(loc="lower right", fontsize=7.5)
    panels[0].set_ylabel("response to a unit step")
    return figure
