"""Closed-loop flights for Monte Carlo on one core: speed and accuracy of Lapwing and RotorPy.

    python -m benchmarks.closed_loop

Simulated seconds per second of processor time, the median of interleaved repeats, of flights of two seconds:

- `hover` as in campaigns, with its metrics (steps of 1 ms, control at 250 Hz);
- RotorPy's Crazyflie (extra `bench`), which flies to a point 0.5 m away under its SE(3) controller, with default
  settings (100 Hz, RK45 of SciPy).

The error is that of the last position relative to the same simulator with an eighth of the step or a relative tolerance
of 1e-10.
"""

import time
from collections.abc import Callable
from importlib.util import find_spec
from statistics import median
from typing import NamedTuple

import numpy as np

from benchmarks._command import command_line
from benchmarks._targets import Row, show
from lapwing.services.scene_resolver import load
from lapwing.studies.campaign.campaign_config import TOPICS, campaign_config
from lapwing.studies.campaign.plan import plan
from lapwing.studies.campaign.runs import row_of
from lapwing.studies.simulate import fly

SECONDS, RUNS, REPEATS = 2.0, 10, 3
AWAY = 0.5  # [m] distance of RotorPy's target
STEP = 1e-3  # [s]
OVERRIDES = (f"run.duration={SECONDS}",)
GIVEN, ROWS = plan("hover", OVERRIDES, runs=1000), {}


def lapwing_flights():
    for run in range(RUNS):
        row_of(GIVEN, run, ROWS)


def lapwing_error():
    steps = STEP, STEP / 8
    ends = [
        fly(campaign_config(load("hover", [*OVERRIDES, f"solver.step={h}"])), TOPICS).truth.position[-1] for h in steps
    ]
    return largest_difference(*ends)


def rotorpy(**integrator):
    """Return the last position [m] of a flight."""
    from rotorpy.controllers.quadrotor_control import SE3Control
    from rotorpy.environments import Environment
    from rotorpy.trajectories.hover_traj import HoverTraj
    from rotorpy.vehicles.crazyflie_params import quad_params
    from rotorpy.vehicles.multirotor import Multirotor

    vehicle = Multirotor(quad_params, integrator_kwargs={"method": "RK45", **integrator})
    trajectory = HoverTraj(x0=np.array([AWAY, 0.0, 0.0]))
    world = Environment(vehicle, SE3Control(quad_params), trajectory, sim_rate=100)
    return world.run(t_final=SECONDS, terminate=False, plot=False)["state"]["x"][-1]


class Simulator(NamedTuple):
    """Closed loop of one simulator."""

    fly: Callable[[], object]  # runs several flights
    flights: int  # number of these flights
    error: Callable[[], float]  # [m] error of the last position


def simulators():
    """Return the installed simulators by name."""
    result = {"lapwing": Simulator(lapwing_flights, RUNS, lapwing_error)}
    if find_spec("rotorpy"):
        result["RotorPy"] = Simulator(
            rotorpy, 1, lambda: largest_difference(rotorpy(), rotorpy(rtol=1e-10, atol=1e-12))
        )
    return result


def largest_difference(one, other):
    """Return the largest difference of two positions [m] along any axis."""
    return np.abs(one - other).max()


def main():
    result = simulators()
    rates = {name: [] for name in result}
    for each in result.values():
        each.fly()  # loads compiled kernels
    for _ in range(REPEATS):
        for name, each in result.items():
            began = time.process_time()
            each.fly()
            rates[name].append(each.flights * SECONDS / (time.process_time() - began))
    for name, each in result.items():
        rate = f"{median(rates[name]):10.1f} times real time"
        print(f"{name:22}{rate}, error of the last position {each.error():.1e} m")
    rows = []
    for name in list(result)[1:]:
        ratio = median(a / b for a, b in zip(rates["lapwing"], rates[name], strict=True))
        rows.append(Row(f"closed-loop flights to {name}, one core", ratio, "", 3.0, True))
    if not rows:
        print("RotorPy is not installed: pip install 'lapwing[bench]'")
    return show(rows)


if __name__ == "__main__":
    command_line(main)
