"""Draw docs/pictures/architecture.png from the run configuration of the delivery mission and the process table.

python docs/pictures/architecture.py
"""

from pathlib import Path
from typing import NamedTuple

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.axes import Axes
from matplotlib.patches import FancyBboxPatch

from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.diagram.compiled_block import Block
from lapwing.cosim.diagram.tick_schedule import InputPort
from lapwing.services.process_table import PROCESSES, create_all
from lapwing.services.scene_resolver import load, resolve

BLUE, ORANGE, GREY, DARK, PALE = "#0072B2", "#D55E00", "#888888", "#333333", "#F3F6F9"


class Box(NamedTuple):
    """A process in the picture."""

    left: float
    bottom: float
    right: float
    top: float


SERVICES = {
    "plant": Box(0.0, 1.0, 2.0, 7.0),
    "sensors": Box(4.6, 4.25, 6.9, 7.0),
    "trajectory": Box(4.95, 2.75, 6.9, 3.6),
    "autopilot": Box(9.6, 1.0, 12.4, 7.0),
}
AUXILIARY = {
    "recorder": Box(0.0, -1.6, 2.0, -0.8),
    "router": Box(4.6, -1.6, 6.9, -0.8),
    "foxglove": Box(2.3, -1.6, 4.3, -0.8),
    "ros2": Box(7.2, -1.6, 9.3, -0.8),
    "mavlink": Box(9.6, -1.6, 12.4, -0.8),
}
LANES = {"battery": 2.35, "actuators": 1.8, "status": 1.35}  # height of arrows that pass under the boxes between
BUS = 0.25  # height of the line of log packets


def rate(config: RunConfig, port: str) -> str:
    """Return the rate of a port as text."""
    return f"{config.rate / config.port(port).period:g} Hz"


def process(axes: Axes, box: Box, name: str, lines: list[tuple[str, str]], dashed: bool = False) -> None:
    """Draw a process: a box with a name, and lines of (text, colour) below it."""
    size = box.right - box.left, box.top - box.bottom
    style = {"fc": PALE, "ec": GREY if dashed else BLUE, "lw": 1.6, "ls": "--" if dashed else "-", "zorder": 3}
    axes.add_patch(FancyBboxPatch(box[:2], *size, boxstyle="round,pad=0,rounding_size=0.12", **style))
    middle = 0.5 * (box.left + box.right)
    axes.text(middle, box.top - 0.25, name, ha="center", va="center", fontsize=11.5, fontweight="bold", zorder=4)
    for i, (text, colour) in enumerate(lines):
        axes.text(
            middle, box.top - 0.62 - 0.31 * i, text, ha="center", va="center", fontsize=8.5, color=colour, zorder=4
        )


def arrow(axes: Axes, x0: float, x1: float, y: float, text: str) -> None:
    """Draw a port from one service to another."""
    style = {"arrowstyle": "-|>", "color": BLUE, "lw": 1.5, "shrinkA": 0, "shrinkB": 0}
    axes.annotate("", (x1, y), (x0, y), arrowprops=style, zorder=2)
    blank = {"boxstyle": "square,pad=0.1", "fc": "white", "ec": "none"}
    axes.text(
        0.5 * (x0 + x1), y + 0.07, text, ha="center", va="bottom", fontsize=8.5, color=DARK, zorder=1.5, bbox=blank
    )


def ports(axes: Axes, config: RunConfig) -> None:
    """Draw an arrow for each port that another service reads."""
    for consumer, service in config.services.items():
        read: dict[str, list[InputPort]] = {}
        for needed in service.inputs:
            read.setdefault(config.producers[needed.port], []).append(needed)
        for producer, inputs in read.items():
            a, b = SERVICES[producer], SERVICES[consumer]
            x0, x1 = (a.right, b.left) if a.right < b.left else (a.left, b.right)
            low, high = max(a.bottom, b.bottom), min(a.top, b.top)
            free = [i for i in inputs if i.port not in LANES]
            heights = {i.port: high - (high - low) * (k + 0.75) / (len(free) + 0.5) for k, i in enumerate(free)}
            for needed in inputs:
                delay = f", delay {needed.delay} tick{'s' * (needed.delay > 1)}" if needed.delay else ""
                text = f"{needed.port}, {rate(config, needed.port)}{delay}"
                arrow(axes, x0, x1, {**heights, **LANES}[needed.port], text)


def log_packets(axes: Axes, config: RunConfig) -> None:
    """Draw the log packets to the auxiliary processes, and the commands from outside."""
    style = {"color": GREY, "lw": 1.1, "ls": ":", "zorder": 1}
    for name, x in {"plant": 1.0, "sensors": 4.75, "trajectory": 6.7, "autopilot": 10.4}.items():
        axes.plot([x, x], [SERVICES[name].bottom, BUS], **style)
    axes.plot([1.0, 10.4], [BUS, BUS], **{**style, "ls": "-"})
    axes.text(8.5, BUS + 0.07, "log packets: encoded messages", ha="center", fontsize=8.5, color=GREY)
    down = {"arrowstyle": "-|>", "color": GREY, "lw": 1.1}
    for name, x in {"recorder": 1.0, "foxglove": 3.3, "mavlink": 10.4}.items():
        axes.annotate("", (x, AUXILIARY[name].top), (x, BUS), arrowprops=down)
    up = {"arrowstyle": "-|>", "color": ORANGE, "lw": 1.4}
    axes.annotate("", (11.6, SERVICES["autopilot"].bottom), (11.6, AUXILIARY["mavlink"].top), arrowprops=up)
    axes.text(11.7, 0.05, "vehicle\ncommands", fontsize=8.5, color=ORANGE, va="center")
    read = {needed.port for service in config.services.values() for needed in service.inputs}
    for name, service in config.services.items():
        box, others = SERVICES[name], [port.name for port in service.ports if port.name not in read]
        if others:
            text = "\n".join(["other outputs:", *others])
            axes.text(
                0.5 * (box.left + box.right), box.bottom + 0.1, text, ha="center", fontsize=8, color=GREY, zorder=4
            )


def draw(path: Path) -> None:
    """Write the picture."""
    config = resolve(load("delivery_mission"))
    figure, axes = plt.subplots(figsize=(12.0, 8.2))
    for number, service in enumerate(create_all(config), 1):
        lines = []
        for block in service.blocks:
            name = block.name.removeprefix(f"{service.name}.")
            python = not isinstance(block, Block)
            lines.append((f"{name} (Python)", ORANGE) if python else (name, DARK))
        process(axes, SERVICES[service.name], f"{number}  {service.name}", lines if len(lines) > 1 else [])
    options = {"recorder": "log.mcap", "router": "--listen: topics for clients", "mavlink": "--mavlink"}
    options |= {"foxglove": "--foxglove", "ros2": "--ros2"}
    for entry in PROCESSES:
        if not entry.lock_step:
            process(axes, AUXILIARY[entry.name], entry.name, [(options[entry.name], GREY)], dashed=True)
    ports(axes, config)
    log_packets(axes, config)
    text = f"{config.scene}: a tick is {1000 / config.rate:g} ms; numbers give the order within a tick"
    axes.text(0.0, 7.3, text, fontsize=10, color=DARK)
    axes.text(12.4, 7.3, "compiled block", fontsize=9, color=DARK, ha="right")
    axes.text(10.9, 7.3, "Python block", fontsize=9, color=ORANGE, ha="right")
    axes.set_xlim(-0.15, 12.75)
    axes.set_ylim(-1.75, 7.6)
    axes.axis("off")
    figure.savefig(path, dpi=110, bbox_inches="tight")
    plt.close(figure)


if __name__ == "__main__":
    draw(Path(__file__).with_suffix(".png"))
