"""Draw docs/pictures/frames.png: the frames inside and on a MAVLink link, and when messages of each rate are due.

python docs/pictures/frames.py
"""

import math
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes

from lapwing.dynamics.lie.quaternion import from_roll_pitch_yaw, rotation_matrix
from lapwing.services.common.schemas.communication_schema import Communication
from lapwing.services.common.schemas.vehicle_schema import airframe
from lapwing.services.scene_resolver import load
from lapwing.services.sensors.schema import parameters

RED, GREEN, BLUE, GREY, DARK = "#D55E00", "#009E73", "#0072B2", "#999999", "#333333"
EAST = np.array([0.80, -0.34])  # of the picture's plane, for a unit along each axis of the world
NORTH = np.array([0.74, 0.34])
UP = np.array([0.0, 1.0])
ATTITUDE = from_roll_pitch_yaw(0.0, -0.10, math.radians(20.0))
PLACE = np.array([0.9, 1.5, 0.9])  # [m] of the vehicle


def seen(point_world: np.ndarray) -> np.ndarray:
    """Return the place of a world point in the picture."""
    return point_world[0] * EAST + point_world[1] * NORTH + point_world[2] * UP


def arrow(axes: Axes, start: np.ndarray, along: np.ndarray, colour: str, text: str) -> None:
    """Draw an axis of a frame; both ends in world coordinates."""
    a, b = seen(start), seen(start + along)
    axes.annotate("", b, a, arrowprops={"arrowstyle": "-|>", "color": colour, "lw": 2.0, "shrinkA": 0, "shrinkB": 0})
    x, y = (b - a) / np.linalg.norm(b - a)
    across, upright = ("left" if x > 0.5 else "center"), ("center" if x > 0.5 else "bottom" if y > 0.0 else "top")
    axes.text(
        b[0] + 0.04 * x, b[1] + 0.04 * y, text, color=colour, fontsize=10, ha=across, va=upright, fontweight="bold"
    )


def frames(axes: Axes, title: str, world: dict[str, tuple], body: dict[str, tuple]) -> None:
    """Draw the axes of world and vehicle, each by name as a vector in ENU or FLU."""
    origin = np.zeros(3)
    for colour, (name, along) in zip((RED, GREEN, BLUE), world.items(), strict=True):
        arrow(axes, origin, np.array(along, float), colour, name)
    R = np.array(rotation_matrix(ATTITUDE)).reshape(3, 3)
    frame = airframe(load("hover"))
    for k, (position, sign) in enumerate(zip(frame.rotors.position, frame.rotors.reaction_sign, strict=True), 1):
        hub = PLACE + R @ (1.7 * np.array(position))
        axes.plot(*zip(seen(PLACE), seen(hub), strict=True), color=DARK, lw=2.5, zorder=3)
        turn = np.linspace(0.15, 1.75 * math.pi, 60) * -sign  # a rotor with sign +1 turns about -z
        rim = [seen(hub + R @ (0.28 * np.array((math.cos(a), math.sin(a), 0.0)))) for a in turn]
        axes.plot(*zip(*rim, strict=True), color=GREY, lw=1.2, zorder=3)
        axes.annotate("", rim[-1], rim[-4], arrowprops={"arrowstyle": "-|>", "color": GREY, "lw": 1.2})
        disc = {"boxstyle": "circle,pad=0.15", "fc": "white", "ec": DARK, "lw": 0.8}
        axes.text(*seen(hub), str(k), fontsize=7.5, ha="center", va="center", color=DARK, zorder=5, bbox=disc)
    for colour, (name, along) in zip((RED, GREEN, BLUE), body.items(), strict=True):
        arrow(axes, PLACE, R @ (1.05 * np.array(along, float)), colour, name)
    a, b = seen(origin), seen(PLACE)
    axes.plot(*zip(a, b, strict=True), color=GREY, lw=1.0, ls=(0, (4, 3)), zorder=1)
    axes.text(*(0.66 * a + 0.34 * b + (-0.08, 0.05)), "position", fontsize=8.5, color=GREY, ha="right")
    axes.set_title(title, fontsize=11, loc="left", color=DARK)
    axes.set_aspect("equal")
    axes.set_xlim(-0.45, 3.35)
    axes.set_ylim(-1.2, 2.45)
    axes.axis("off")


def schedule(axes: Axes) -> None:
    """Draw the messages due at each tick of the delivery mission."""
    scene = load("delivery_mission")
    exchange, last = scene[Communication], 54
    rows = []
    for name in ("imu", "magnetometer", "barometer", "sonar", "gps"):
        p = parameters(name, scene.tables("sensors")[name], exchange.interval)
        rows.append((name, round(exchange.rate / p.rate), p.rate, p.latency_samples))
    for y, (name, period, rate, latency) in enumerate(reversed(rows)):
        ticks = np.arange(0, last, period)
        axes.plot([0, last], [y, y], color="#E3E6E9", lw=1.0, zorder=1)
        axes.plot(ticks, np.full(len(ticks), y), "o", color=BLUE, ms=4.5, zorder=3)
        axes.text(-1.2, y, f"{name}, {rate:g} Hz", fontsize=9, ha="right", va="center", color=DARK)
        if latency:
            for tick in ticks[ticks >= latency * period]:
                bow = {"arrowstyle": "->", "color": RED, "lw": 1.2, "connectionstyle": "arc3,rad=0.12"}
                axes.annotate("", (tick - latency * period, y - 0.1), (tick, y - 0.1), arrowprops=bow)
    axes.text(last + 0.6, 0, "the stamp is the instant\nthat the fix is valid for", fontsize=8, color=RED, va="center")
    axes.set_xlim(-0.5, last)
    axes.set_ylim(-0.9, len(rows) - 0.5)
    axes.set_yticks([])
    axes.set_xticks(range(0, last, 5))
    axes.set_xlabel(f"tick; one is {exchange.interval_ns:,} ns".replace(",", " "), fontsize=9)
    axes.tick_params(labelsize=8)
    for side in ("left", "right", "top"):
        axes.spines[side].set_visible(False)
    axes.set_title("Time: a message is due at every multiple of its port's period", fontsize=11, loc="left", color=DARK)


def draw(path: Path) -> None:
    """Write the picture."""
    figure = plt.figure(figsize=(10.5, 7.0))
    grid = figure.add_gridspec(2, 2, height_ratios=(3.0, 1.0), hspace=0.08, wspace=0.02)
    frames(
        figure.add_subplot(grid[0, 0]),
        "Everywhere: world ENU, body FLU",
        {"east x": (1, 0, 0), "north y": (0, 1, 0), "up z": (0, 0, 1)},
        {"forward x": (1, 0, 0), "left y": (0, 1, 0), "up z": (0, 0, 1)},
    )
    frames(
        figure.add_subplot(grid[0, 1]),
        "On a MAVLink link: NED, FRD",
        {"north x": (0, 1, 0), "east y": (1, 0, 0), "down z": (0, 0, -1)},
        {"forward x": (1, 0, 0), "right y": (0, -1, 0), "down z": (0, 0, -1)},
    )
    schedule(figure.add_subplot(grid[1, :]))
    figure.savefig(path, dpi=110, bbox_inches="tight")
    plt.close(figure)


if __name__ == "__main__":
    draw(Path(__file__).with_suffix(".png"))
