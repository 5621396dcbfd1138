"""Figures of docs/explanation/validation.md, drawn from the JSON file of `lapwing validate`.

    python -m benchmarks.validation_figures ERRORS FOLDER

Writes `validation_errors.png`: mean absolute errors of plant and linear fit over those of constant velocity, at the
last horizon, and errors of each flight.
"""

import json
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from benchmarks._command import command_line

FIELDS = ("position", "velocity", "attitude", "rate")
COLOURS = {"plant": "#1b6ca8", "linear fit": "#c44536"}


def main(errors: Path, folder: Path) -> None:
    content = json.loads(errors.read_text(encoding="utf-8"))
    last = content["horizons"][-1]
    baseline = last["baselines"]["constant_velocity"]
    shares = {
        "plant": [last[name] / baseline[name] for name in FIELDS],
        "linear fit": [last["baselines"]["linear_fit"][name] / baseline[name] for name in FIELDS],
    }
    figure, (left, right) = plt.subplots(1, 2, figsize=(10.0, 3.6), layout="constrained")
    place = np.arange(len(FIELDS))
    for k, (name, values) in enumerate(shares.items()):
        left.bar(place + 0.4 * (k - 0.5), values, 0.38, color=COLOURS[name], label=name)
    interval = np.array([last["confidence_95"][name] for name in FIELDS]) / np.array([[baseline[n]] for n in FIELDS])
    middle = np.array(shares["plant"])
    left.errorbar(place - 0.2, middle, np.abs(interval.T - middle), fmt="none", ecolor="black", capsize=3, label="95 %")
    left.axhline(1.0, color="grey", linestyle="--", linewidth=1.0, label="constant velocity")
    left.set_xticks(place, FIELDS)
    left.set_ylabel("error / that of constant velocity")
    left.set_title(f"after {last['time']:g} s, {last['windows']} windows")
    left.legend(fontsize=8)
    families = sorted({name.partition("_rep")[0] for name in content["flights"]})
    for k, family in enumerate(families):
        rows = [row for name, row in content["flights"].items() if name.partition("_rep")[0] == family]
        right.plot([row["rate"] for row in rows], [k] * len(rows), "o", color=COLOURS["plant"], markersize=4)
        right.plot([row["attitude"] for row in rows], [k] * len(rows), "s", color=COLOURS["linear fit"], markersize=4)
    right.plot([], [], "o", color=COLOURS["plant"], label="rate [rad/s]")
    right.plot([], [], "s", color=COLOURS["linear fit"], label="attitude [rad]")
    right.set_yticks(range(len(families)), families, fontsize=8)
    right.set_xlim(left=0.0)
    right.set_xlabel(f"mean absolute error after {last['time']:g} s [rad], [rad/s]")
    right.set_title("each flight, plant")
    right.legend(fontsize=8)
    figure.savefig(folder / "validation_errors.png", dpi=110)


if __name__ == "__main__":
    command_line(main)
