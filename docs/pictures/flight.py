"""Draw docs/pictures/flight.gif: the delivery mission in random wind, its path and its tracking error.

python docs/pictures/flight.py
"""

from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.animation import FuncAnimation, PillowWriter

import lapwing
from lapwing.dynamics.lie.quaternion import rotation_matrix

TARGET = Path(__file__).with_name("flight.gif")
FRAMES, RATE = 72, 12  # pictures, and pictures per second
ARM = 1.4  # [m] half the drawn length of an arm: several times the real one, to be seen
ANGLES = np.deg2rad([45.0, 135.0, 225.0, 315.0])
TIPS = ARM * np.stack([np.cos(ANGLES), np.sin(ANGLES), np.zeros(4)])
BLUE, ORANGE, GREY = "#0072B2", "#D55E00", "#999999"


def main() -> None:
    """Fly the mission and write the picture."""
    flight = lapwing.fly("delivery_mission", seed=1)
    desired = flight.reference[:, :3]
    count = len(desired)
    times, path = flight.truth.times[:count], flight.truth.position[:count]
    attitude = flight.truth.orientation[:count]
    error = np.linalg.norm(path - desired, axis=1)
    picks = np.linspace(0, len(times) - 1, FRAMES).astype(int)

    figure = plt.figure(figsize=(8.0, 4.2), dpi=70)
    space = figure.add_axes((0.0, 0.02, 0.53, 0.98), projection="3d")
    plot = figure.add_axes((0.66, 0.15, 0.32, 0.78))
    space.plot(*desired.T, color=GREY, linewidth=1.0, linestyle="--", label="desired")
    (trail,) = space.plot([], [], [], color=BLUE, linewidth=1.8, label="flown")
    arms = [space.plot([], [], [], color=ORANGE, linewidth=3.0, solid_capstyle="round")[0] for _ in range(2)]
    (shadow,) = space.plot([], [], [], color="black", alpha=0.25, linewidth=1.0)
    space.set(xlim=(-1, 12), ylim=(-1, 12), zlim=(0, 12), xlabel="east [m]", ylabel="north [m]", zlabel="up [m]")
    space.view_init(elev=22, azim=-60)
    space.legend(loc="upper left", frameon=False)
    plot.set(xlim=(0, times[-1]), ylim=(0, 100 * error.max() * 1.05), xlabel="time [s]", ylabel="tracking error [cm]")
    (curve,) = plot.plot([], [], color=BLUE)
    plot.grid(alpha=0.3)

    def draw(i: int) -> None:
        k = picks[i]
        trail.set_data_3d(*path[: k + 1].T)
        shadow.set_data_3d(path[: k + 1, 0], path[: k + 1, 1], np.zeros(k + 1))
        tips = np.array(rotation_matrix(tuple(attitude[k]))).reshape(3, 3) @ TIPS + path[k][:, None]
        for arm, (a, b) in zip(arms, ((0, 2), (1, 3)), strict=True):
            arm.set_data_3d(tips[0, [a, b]], tips[1, [a, b]], tips[2, [a, b]])
        curve.set_data(times[: k + 1], 100 * error[: k + 1])

    FuncAnimation(figure, draw, frames=FRAMES).save(TARGET, writer=PillowWriter(fps=RATE))


if __name__ == "__main__":
    main()
