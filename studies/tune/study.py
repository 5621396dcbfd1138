"""The whole of `lapwing tune`: linearise, look at the gains that are there, design new ones, show both, write them."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from rich.table import Table

from services.autopilot.config import Autopilot
from services.autopilot.gains import GainSet, build
from services.autopilot.margins import Margins, margins, open_loops
from services.autopilot.service import known_airframe
from services.scene import Scene
from services.sections import Exchange
from studies.tune.design import DELAY, Bandwidths, believed, design, shortfalls
from studies.tune.linearise import Hover, hover


class Tuned(NamedTuple):
    """What has been found: margins of each loop with the scene's own gains and with the new ones."""

    model: Hover
    gains: GainSet
    before: dict[str, Margins]
    after: dict[str, Margins]


def tune(scene: Scene, wanted: Bandwidths, say: Callable[[str], None]) -> Tuned:
    """Design a gain set for the scene's vehicle about hover.

    Raises:
        ValueError: the scene has no autopilot, its vehicle cannot hover, or no gains hold the margins.
    """
    if not scene.has(Autopilot):
        raise ValueError(f"{scene.path}: has no [autopilot] to tune; expected a scene whose vehicle it flies")
    for name, value in wanted._asdict().items():
        if not 0.0 < value < math.inf:
            raise ValueError(f"--{name} {value:g}: expected a bandwidth above 0 rad/s")
    airframe, tick = known_airframe(scene), scene[Exchange].interval
    model = hover(scene)
    config = scene[Autopilot]
    loops = open_loops(build(config.gain_set(scene), airframe), believed(airframe, model), tick, DELAY)
    for name, why in shortfalls(loops).items():
        say(f"warning: gains {config.gains}: {name}: {why}")
    gains, after = design(model, airframe, tick, wanted, say)
    return Tuned(model, gains, {name: margins(response) for name, response in loops.items()}, after)


def table(found: Tuned) -> Table:
    """Margins before and after, a loop a row."""
    rows = Table("loop", title="crossover in rad/s, phase margin in degrees, gain margin up/down in dB")
    rows.add_column("before", justify="right")
    rows.add_column("after", justify="right")
    for name in found.after:
        rows.add_row(name, _cell(found.before[name]), _cell(found.after[name]))
    return rows


def write(path: Path, gains: GainSet) -> None:
    """Write a gain set as a scene can name it."""
    lines = ["# Force quota [N] of every rotor, or tilt [rad], per [m] or [rad]: P, I, D"]
    for key, value in gains.model_dump().items():
        if isinstance(value, tuple):
            value = list(value)
        text = f'"{value}"' if isinstance(value, str) else str(value).lower()
        lines.append(f"{key} = {text}")
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _cell(m: Margins) -> str:
    up, down = (20.0 * math.log10(k) if k > 0.0 else -math.inf for k in (m.gain, m.reduction))
    return f"{m.crossover:.1f}, {math.degrees(m.phase):.1f}, {up:+.1f}/{down:+.1f}"
