"""Gymnasium environments: a `lapwing.BatchSimulator` under thrust and body rates, with a task."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from lapwing.batch_simulator import BatchSimulator
from lapwing.cosim.scene import Overrides, Scene, SceneError
from lapwing.gym import step_kernels
from lapwing.gym.step_kernels import BOUNDS, Episodes, Results
from lapwing.gym.tasks import TASKS, starts
from lapwing.studies.campaign.distributions import Distribution

try:
    import gymnasium
    from gymnasium.spaces import Box
    from gymnasium.utils import seeding
    from gymnasium.vector import AutoresetMode, VectorEnv
    from gymnasium.vector.utils import batch_space
except ImportError:
    raise ImportError("lapwing.gym: Gymnasium is not installed; pip install lapwing[gym]") from None

RATE = 50.0  # [Hz] rate of the actions


class DroneVectorEnv(VectorEnv):
    """Vector environment: n vehicles of a scene with one task.

    An action is (thrust, rates about body x, y, z), each from -1 to 1: no thrust to twice the weight; 6, 6 and 2 rad/s.
    An observation is the displacement to the target and to the next target [m], the velocity relative to the target
    [m/s], all in the world frame; the rotation matrix body to world, row by row; and the body rates [rad/s].
    Displacements, velocities and rates saturate at 50, the bounds of the observation space. An episode ends if the
    state becomes invalid. An episode that has ended restarts with the next step.
    """

    metadata = {"autoreset_mode": AutoresetMode.NEXT_STEP, "render_modes": []}  # noqa: RUF012

    def __init__(
        self,
        num_envs: int = 1,
        task: str = "Hover",
        scene: Scene | str | Path = "hover",
        overrides: Overrides = (),
        vary: Mapping[str, Distribution] | None = None,
        render_mode: None = None,
    ):
        """Create the environments.

        Args:
            num_envs: number of vehicles.
            task: one of `TASKS`.
            scene: path or name of a scene, or a loaded scene.
            overrides: see `lapwing.load_scene`.
            vary: distributions of scene keys over the vehicles.
            render_mode: not supported.

        Raises:
            ValueError: unknown task.
            SceneError: the scene is invalid.
        """
        if task not in TASKS:
            raise ValueError(f"task: expected one of {', '.join(TASKS)}, got {task!r}")
        self.task, self.num_envs, self.render_mode = TASKS[task], num_envs, render_mode
        self.batch = BatchSimulator(scene, num_envs, vary, overrides)
        if not self.batch.level_ground:
            raise SceneError(
                "environment.terrain", "tasks are over level ground", "a scene without slope, bumps and steps"
            )
        self._ticks = max(1, round(1.0 / (RATE * self.batch.interval)))
        self._ground = float(self.batch.state.position_world[0, 2])
        self._vehicles = step_kernels.Vehicles(*self.batch.memory, self.batch.interval, self._ground)
        self._weight, self._hover_speed = self.batch.weight, self.batch.hover_speed
        self.single_action_space = Box(-1.0, 1.0, (4,), np.float32)
        self.single_observation_space = Box(-BOUNDS, BOUNDS, dtype=np.float32)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self._episodes = Episodes(np.zeros(num_envs, np.int64), np.zeros(num_envs, bool), np.zeros((num_envs, 6)))

    def reset(self, *, seed: int | None = None, options: dict | None = None) -> tuple[np.ndarray, dict]:
        """Start an episode with every vehicle."""
        if seed is not None:
            self._np_random, self._np_random_seed = seeding.np_random(seed)
        observations = np.empty((self.num_envs, len(BOUNDS)), np.float32)
        self._begin(np.arange(self.num_envs), observations)
        return observations, {}

    def step(self, actions: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, dict]:
        """Advance by 20 ms; episodes that have ended restart instead.

        Raises:
            ValueError: actions of another shape, or not finite.
        """
        n, batch, episodes = self.num_envs, self.batch, self._episodes
        numbers = np.asarray(actions, float)
        if numbers.size != 4 * n:
            raise ValueError(f"actions: expected 4 numbers for each vehicle, shape ({n}, 4), got {numbers.shape}")
        numbers = numbers.reshape(n, 4)
        if not step_kernels.read_actions(numbers, self._weight, batch.setpoints):
            raise ValueError("actions: expected finite numbers")
        shape = (n, len(BOUNDS))
        results = Results(np.empty(shape, np.float32), np.empty(n), np.empty(n, bool), np.empty(n, bool))

        def work(first: int, last: int) -> None:
            batch.advance_under_rates(first, last, self._ticks)
            step_kernels.judge(self.task, self._vehicles, episodes, results, first, last)

        batch.run_blocks(work)
        if episodes.over.any():
            self._begin(np.flatnonzero(episodes.over), results.observations)
        np.logical_or(results.terminated, results.truncated, out=episodes.over)
        return *results, {}

    def _begin(self, members: np.ndarray, observations: np.ndarray) -> None:
        """Start episodes of these vehicles, and write their observations."""
        positions = starts(self.np_random, self._ground, len(members))
        self.batch.restart(members, position_world=positions, rotor_speed=self._hover_speed)
        self._episodes.gates[members], self._episodes.over[members] = 0, False
        step_kernels.observe_members(self.task, self._vehicles, self._episodes, observations, members)


class DroneEnv(gymnasium.Env):
    """Environment with one vehicle; see `DroneVectorEnv` for its arguments, except `num_envs`."""

    metadata: dict[str, Any] = {"render_modes": []}  # noqa: RUF012

    def __init__(self, render_mode: None = None, **arguments: Any):
        self.render_mode, self._vector_env = render_mode, DroneVectorEnv(1, **arguments)
        self.action_space = self._vector_env.single_action_space
        self.observation_space = self._vector_env.single_observation_space

    def reset(self, *, seed: int | None = None, options: dict | None = None) -> tuple[np.ndarray, dict]:
        """Start an episode."""
        super().reset(seed=seed)
        observations, _ = self._vector_env.reset(seed=seed)
        return observations[0], {}

    def step(self, action: Any) -> tuple[np.ndarray, float, bool, bool, dict]:
        """Advance by 20 ms."""
        observations, reward, terminated, truncated, _ = self._vector_env.step(np.asarray(action)[None])
        return observations[0], float(reward[0]), bool(terminated[0]), bool(truncated[0]), {}


for _task in TASKS:
    gymnasium.register(
        f"lapwing/{_task}-v0",
        entry_point="lapwing.gym:DroneEnv",
        vector_entry_point="lapwing.gym:DroneVectorEnv",
        kwargs={"task": _task},
    )
