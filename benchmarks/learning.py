"""Learning to hover: the agent of examples/ppo_hover.py in lapwing.gym and in gym-pybullet-drones' HoverAviary.

    python -m benchmarks.learning [STEPS]

STEPS are those of the environments, of all vehicles together, the same for both; each simulator has a process of its
own. gym-pybullet-drones has one vehicle an environment: Gymnasium's SyncVectorEnv of them, one after the other. It is
left out where it is not installed (`pip install git+https://github.com/utiasDSL/gym-pybullet-drones`).
"""

import multiprocessing
import sys
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from contextlib import redirect_stdout
from importlib.util import find_spec
from typing import Any, NamedTuple

import numpy as np

STEPS, ALONE, WARM = 3000 * 256, 200, 20  # ALONE: actions of each vehicle without an agent, after WARM
SLOW = True


class Contestant(NamedTuple):
    """A simulator with its own task of hovering."""

    made: Callable[[int], Any]  # a vector environment of so many vehicles
    way: Callable[[np.ndarray], np.ndarray]  # to the target [m], (n, 3), of its observations
    judges: int  # vehicles that show how well it flies


def lapwing_gym(n):
    """Start up to 2 m from the target, ten seconds, actions of 20 ms: thrust and body rates."""
    from examples import ppo_hover

    return ppo_hover.made(n)


def hover_aviary(n):
    """Start on the ground below the target, eight seconds, actions of 33 ms: rotor speeds. As it ships, but flat."""
    from gym_pybullet_drones.envs.HoverAviary import HoverAviary
    from gym_pybullet_drones.utils.enums import ActionType, ObservationType
    from gymnasium.spaces import Box
    from gymnasium.vector import SyncVectorEnv
    from gymnasium.wrappers import FlattenObservation, TransformAction

    def one():
        alone = FlattenObservation(HoverAviary(obs=ObservationType.KIN, act=ActionType.RPM))
        flat = Box(-1.0, 1.0, (4,), np.float32)  # it clips no actions itself
        return TransformAction(alone, lambda action: np.clip(action, -1.0, 1.0).reshape(1, 4), flat)

    with redirect_stdout(None):  # it prints its parameters
        return SyncVectorEnv([one] * n)


CONTESTANTS = {  # by the package that they need
    "lapwing": Contestant(lapwing_gym, lambda observed: observed[:, :3], 64),
    "gym_pybullet_drones": Contestant(hover_aviary, lambda observed: (0.0, 0.0, 1.0) - observed[:, :3], 1),
}  # the second begins every episode alike


def main(steps=STEPS):
    if not find_spec("skrl"):
        print("skrl is not installed: pip install 'lapwing[learn]'")
        return
    there = [name for name in CONTESTANTS if find_spec(name)]
    if "gym_pybullet_drones" not in there:
        print("gym-pybullet-drones is not installed: pip install git+https://github.com/utiasDSL/gym-pybullet-drones")
    for name in there:
        context = multiprocessing.get_context("spawn")
        with ProcessPoolExecutor(1, context) as alone:
            rate, cost, took, before, after = alone.submit(measure, name, steps).result()
        print(f"{name}: {rate:.0f} environment steps a second, {1e6 * cost:.1f} us of processor time each, alone")
        print(f"  learning {steps} of them: {took[0]:.0f} s, {took[1]:.0f} s of processor time")
        for when, (total, away, flight) in (("before", before), ("after", after)):
            print(f"  {when:6} return {total:6.1f}, {away:.2f} m from the target after {flight:.0f} actions")


def measure(name, steps):
    """Train a contestant.

    Returns:
        environment steps a second [1/s] and processor time of one [s], with random actions;
        (wall, processor) time of learning [s]; what `ppo_hover.judged` says before it and after it.
    """
    from skrl.envs.wrappers.jax import wrap_env
    from skrl.utils import set_seed

    from examples import ppo_hover

    contestant = CONTESTANTS[name]
    set_seed(1)
    environments, judges = contestant.made(ppo_hover.VEHICLES), contestant.made(contestant.judges)
    wall, processor = random_actions(environments)
    n = ALONE * environments.num_envs
    environments = wrap_env(environments, verbose=False)
    agent = ppo_hover.learner(environments)
    before = ppo_hover.judged(agent, judges, contestant.way)
    took = timed(lambda: ppo_hover.train(agent, environments, steps // environments.num_envs))
    after = ppo_hover.judged(agent, judges, contestant.way)
    return n / wall, processor / n, took, before, after


def random_actions(environments):
    """(wall, processor) time [s] of ALONE steps of all vehicles, with the resets that they need."""
    environments.reset(seed=1)
    environments.action_space.seed(1)
    actions = [environments.action_space.sample() for _ in range(WARM + ALONE)]
    for action in actions[:WARM]:
        environments.step(action)
    return timed(lambda: [environments.step(action) for action in actions[WARM:]])


def timed(work):
    """(wall, processor) time that it takes [s]."""
    began, processor = time.perf_counter(), time.process_time()
    work()
    return time.perf_counter() - began, time.process_time() - processor


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
