"""Learning to hover: the agent of examples/ppo_hover.py in lapwing.gym and in gym-pybullet-drones' HoverAviary.

    python -m benchmarks.learning [--steps N]

N is the number of environment steps of all vehicles together, equal for both; each simulator runs in a separate
process. gym-pybullet-drones has one vehicle per environment: Gymnasium's SyncVectorEnv steps them one after another. It
is skipped if it is not installed (`pip install git+https://github.com/utiasDSL/gym-pybullet-drones`).
"""

import multiprocessing
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from contextlib import redirect_stdout
from importlib.util import find_spec
from typing import Any, NamedTuple

import numpy as np

from benchmarks._command import command_line

STEPS, ALONE, WARM = 3000 * 256, 200, 20  # actions of each vehicle without an agent: ALONE after WARM
SLOW = True


class Contestant(NamedTuple):
    """Simulator with its own hover task."""

    create: Callable[[int], Any]  # returns a vector environment of a number of vehicles
    displacement: Callable[[np.ndarray], np.ndarray]  # observations to displacement to the target [m], (n, 3)
    evaluated: int  # number of vehicles in the evaluation


def lapwing_gym(n):
    """Return environments: start up to 2 m from the target, ten seconds, actions of 20 ms: thrust and body rates."""
    from examples import ppo_hover

    return ppo_hover.create_environments(n)


def hover_aviary(n):
    """Return environments: start on the ground below the target, eight seconds, actions of 33 ms: rotor speeds.

    The shipped environment with flat observations.
    """
    from gym_pybullet_drones.envs.HoverAviary import HoverAviary
    from gym_pybullet_drones.utils.enums import ActionType, ObservationType
    from gymnasium.spaces import Box
    from gymnasium.vector import SyncVectorEnv
    from gymnasium.wrappers import FlattenObservation, TransformAction

    def one():
        alone = FlattenObservation(HoverAviary(obs=ObservationType.KIN, act=ActionType.RPM))
        flat = Box(-1.0, 1.0, (4,), np.float32)  # it does not clip actions
        return TransformAction(alone, lambda action: np.clip(action, -1.0, 1.0).reshape(1, 4), flat)

    with redirect_stdout(None):  # it prints its parameters
        return SyncVectorEnv([one] * n)


CONTESTANTS = {  # by required package
    "lapwing": Contestant(lapwing_gym, lambda observations: observations[:, :3], 64),
    "gym_pybullet_drones": Contestant(hover_aviary, lambda observations: (0.0, 0.0, 1.0) - observations[:, :3], 1),
}  # all episodes of the second start equally


def main(steps: int = STEPS) -> None:
    if not find_spec("skrl"):
        print("skrl is not installed: pip install 'lapwing[learn]'")
        return
    installed = [name for name in CONTESTANTS if find_spec(name)]
    if "gym_pybullet_drones" not in installed:
        print("gym-pybullet-drones is not installed: pip install git+https://github.com/utiasDSL/gym-pybullet-drones")
    for name in installed:
        context = multiprocessing.get_context("spawn")
        with ProcessPoolExecutor(1, context) as alone:
            rate, cost, took, before, after = alone.submit(measure, name, steps).result()
        print(f"{name}: {rate:.0f} environment steps per second, {1e6 * cost:.1f} us of processor time each, alone")
        print(f"  learning {steps} of them: {took[0]:.0f} s, {took[1]:.0f} s of processor time")
        for when, (total, away, flight) in (("before", before), ("after", after)):
            print(f"  {when:6} return {total:6.1f}, {away:.2f} m from the target after {flight:.0f} actions")


def measure(name, steps):
    """Train a contestant.

    Returns:
        environment steps per second [1/s] and processor time of one [s], with random actions;
        (wall, processor) time of learning [s]; results of `ppo_hover.evaluate` before and after it.
    """
    from skrl.envs.wrappers.jax import wrap_env
    from skrl.utils import set_seed

    from examples import ppo_hover

    contestant = CONTESTANTS[name]
    set_seed(1)
    environments, evaluated = contestant.create(ppo_hover.VEHICLES), contestant.create(contestant.evaluated)
    wall, processor = random_actions(environments)
    n = ALONE * environments.num_envs
    environments = wrap_env(environments, verbose=False)
    agent = ppo_hover.create_agent(environments)
    before = ppo_hover.evaluate(agent, evaluated, contestant.displacement)
    took = timed(lambda: ppo_hover.train(agent, environments, steps // environments.num_envs))
    after = ppo_hover.evaluate(agent, evaluated, contestant.displacement)
    return n / wall, processor / n, took, before, after


def random_actions(environments):
    """Return (wall, processor) time [s] of ALONE steps of all vehicles, including resets."""
    environments.reset(seed=1)
    environments.action_space.seed(1)
    actions = [environments.action_space.sample() for _ in range(WARM + ALONE)]
    for action in actions[:WARM]:
        environments.step(action)
    return timed(lambda: [environments.step(action) for action in actions[WARM:]])


def timed(work):
    """Return (wall, processor) time [s] of a function call."""
    began, processor = time.perf_counter(), time.process_time()
    work()
    return time.perf_counter() - began, time.process_time() - processor


if __name__ == "__main__":
    command_line(main)
