"""Closed-loop flights for Monte Carlo on one core: ours beside RotorPy's, and how exact each is.

    python -m benchmarks.closed_loop

Simulated seconds to a second of processor time, the median of interleaved repeats, of flights of two seconds: `hover`
as campaigns fly it, with its figures (steps of 1 ms, control at 250 Hz); RotorPy's Crazyflie that goes to a point 0.5 m
away under its SE(3) controller, as it comes (100 Hz, RK45 of SciPy). The error is that of the last position, against
the same simulator at an eighth of the step or a relative tolerance of 1e-10. What is not installed (extra `bench`) is
left out.
"""

import time
from importlib.util import find_spec
from statistics import median

import numpy as np

from benchmarks._bars import Row, show
from services.table import load
from studies.campaign.plan import plan
from studies.campaign.runs import row_of
from studies.campaign.setup import TOPICS, campaign_setup
from studies.fly import fly

SECONDS, RUNS, REPEATS = 2.0, 10, 3
OVERRIDES = (f"run.duration={SECONDS}",)
GIVEN, ROWS = plan("hover", OVERRIDES, runs=1000), {}


def ours():
    for run in range(RUNS):
        row_of(GIVEN, run, ROWS)
    return RUNS * SECONDS


def our_error():
    steps = 1e-3, 1e-3 / 8
    ends = [
        fly(campaign_setup(load("hover", [*OVERRIDES, f"solver.step={h}"])), TOPICS).truth.position[-1] for h in steps
    ]
    return np.abs(ends[0] - ends[1]).max()


def rotorpy(**integrator):
    """The last position [m] of a flight."""
    from rotorpy.controllers.quadrotor_control import SE3Control
    from rotorpy.environments import Environment
    from rotorpy.trajectories.hover_traj import HoverTraj
    from rotorpy.vehicles.crazyflie_params import quad_params
    from rotorpy.vehicles.multirotor import Multirotor

    vehicle = Multirotor(quad_params, integrator_kwargs={"method": "RK45", **integrator})
    trajectory = HoverTraj(x0=np.array([0.5, 0.0, 0.0]))
    world = Environment(vehicle, SE3Control(quad_params), trajectory, sim_rate=100)
    return world.run(t_final=SECONDS, terminate=False, plot=False)["state"]["x"][-1]


def main():
    if not find_spec("rotorpy"):
        print("rotorpy is not installed: pip install 'lapwing[bench]'")
        return []
    ours(), rotorpy()
    rates = {"lapwing": [], "RotorPy": []}
    for _ in range(REPEATS):
        for name, fly_some in (("lapwing", ours), ("RotorPy", lambda: SECONDS if rotorpy() is not None else 0.0)):
            began = time.process_time()
            simulated = fly_some()
            rates[name].append(simulated / (time.process_time() - began))
    errors = our_error(), np.abs(rotorpy() - rotorpy(rtol=1e-10, atol=1e-12)).max()
    for (name, found), error in zip(rates.items(), errors, strict=True):
        print(f"{name:8}{median(found):10.1f} times real time, error of the last position {error:.1e} m")
    ratio = median(a / b for a, b in zip(*rates.values(), strict=True))
    found = [Row("closed-loop flights to RotorPy, one core", ratio, "", 3.0, True)]
    show(found)
    return found


if __name__ == "__main__":
    main()
