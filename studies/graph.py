"""A picture of the services of a scene and the topics between them, read from what the services declare.

python -m studies.graph scenes/delivery_mission.toml docs/pictures/services.png
"""

import sys
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt

from services.lockstep import Service
from services.scene import load
from services.sections import Vehicle
from services.table import RECORDER, lockstep_services

BLUE, GREY = "#1f5fa8", "#666666"
PLACES = {"plant": (0.0, 1.0), "sensors": (1.0, 1.0), "autopilot": (1.0, 0.0), "trajectory": (0.0, 0.0)}


def topics_between(services: dict[str, Service], vehicle: str) -> dict[tuple[str, str], list[str]]:
    """The topics' names for each pair (producer, consumer); "*" for those that wait a tick."""
    found: dict[tuple[str, str], list[str]] = {}
    for consumer, service in services.items():
        for needed in service.inputs:
            for producer, other in services.items():
                if needed.topic in other.outputs:
                    name = needed.topic.key(vehicle) + ("*" if needed.delay else "")
                    found.setdefault((producer, consumer), []).append(name)
    return found


def draw(services: dict[str, Service], vehicle: str, path: Path) -> None:
    """Write the picture as PNG."""
    figure, axes = plt.subplots(figsize=(9.0, 5.4))
    places = {name: (4.6 * x, 2.8 * y) for name, (x, y) in PLACES.items() if name in services}
    for name in services.keys() - places.keys():
        places[name] = (4.6 * (1 + len(places) - len(PLACES)), 1.0)
    between = topics_between(services, vehicle)
    for (producer, consumer), names in between.items():
        (x0, y0), (x1, y1) = places[producer], places[consumer]
        axes.annotate(
            "",
            (x1, y1),
            (x0, y0),
            arrowprops={
                "arrowstyle": "-|>", "color": BLUE, "lw": 1.6, "shrinkA": 34, "shrinkB": 34,
            },
        )  # fmt: skip
        share = 0.3 if (consumer, producer) in between else 0.5  # names for both ways must not meet
        there = (x0 + share * (x1 - x0), y0 + share * (y1 - y0))
        label: Any = {
            "ha": "center",
            "va": "center",
            "fontsize": 8,
            "color": GREY,
            "backgroundcolor": "white",
            "zorder": 4,
        }
        axes.text(*there, "\n".join(names), **label)
    for name, (x, y) in places.items():
        style = {"boxstyle": "round,pad=0.6", "fc": "white", "ec": BLUE, "lw": 1.8}
        axes.text(x, y, name, ha="center", va="center", fontsize=12, bbox=style)
    recorded = sorted(t.key(vehicle) for service in services.values() for t in service.outputs if t.recorded)
    lines = [", ".join(recorded[i : i + 6]) for i in range(0, len(recorded), 6)]
    box = {"boxstyle": "round,pad=0.5", "fc": "#f4f4f4", "ec": GREY}
    text = f"{RECORDER} (journals of all services): " + ",\n".join(lines)
    axes.text(2.3, -0.95, text, ha="center", va="center", fontsize=8, color=GREY, bbox=box)
    note = "* taken later: the command one exchange, the clock 0.1 s (how far setpoints may be ahead)"
    axes.text(2.3, -1.6, note, ha="center", fontsize=7.5, color=GREY)
    axes.set_xlim(-1.0, 5.6)
    axes.set_ylim(-1.7, 3.2)
    axes.axis("off")
    figure.savefig(path, dpi=130, bbox_inches="tight")
    plt.close(figure)


if __name__ == "__main__":
    scene = load(sys.argv[1])
    draw(lockstep_services(scene), scene[Vehicle].name, Path(sys.argv[2]))
