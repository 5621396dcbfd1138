"""Gymnasium environments: a `lapwing.BatchSimulator` under thrust and body rates, with a task."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from lapwing.api.batch_simulator import BatchSimulator
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
    _generators: tuple[np.random.Generator, ...] | None = None  # that of each vehicle, after a list of seeds
    _seeds: tuple[int, ...] = ()

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

    def __getstate__(self) -> dict[str, Any]:
        """Return the state for copies and pickles, without the view of the memory of `batch`."""
        return {name: value for name, value in vars(self).items() if name != "_vehicles"}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Restore a copy, which continues from the same states and random numbers."""
        vars(self).update(state)
        self._vehicles = step_kernels.Vehicles(*self.batch.memory, self.batch.interval, self._ground)

    @property  # type: ignore[override]
    def np_random(self) -> np.random.Generator | tuple[np.random.Generator, ...]:
        """Generator of all vehicles; after a reset with a list of seeds, that of each."""
        return super().np_random if self._generators is None else self._generators

    @np_random.setter
    def np_random(self, value: np.random.Generator) -> None:
        self._np_random, self._np_random_seed, self._generators = value, -1, None

    @property
    def np_random_seed(self) -> int | tuple[int, ...] | None:  # type: ignore[override]
        """Seed of `np_random`, or of each of its generators; -1 if unknown."""
        return super().np_random_seed if self._generators is None else self._seeds

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict | None = None
    ) -> tuple[np.ndarray, dict]:
        """Start an episode with every vehicle.

        Args:
            seed: seed of one generator for all vehicles, or a seed for each, with which a vehicle starts as that of a
                `DroneEnv` with the same seed; None continues with the present random numbers.
            options: not used.

        Raises:
            ValueError: the list has not one seed for each vehicle.
        """
        if isinstance(seed, Sequence | np.ndarray):
            self._seed_each(seed)
        elif seed is not None:
            self._np_random, self._np_random_seed = seeding.np_random(seed)
            self._generators = None
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

    def _seed_each(self, seeds: Sequence[int | None]) -> None:
        if len(seeds) != self.num_envs:
            raise ValueError(f"seed: expected {self.num_envs} seeds, one for each vehicle, got {len(seeds)}")
        present = zip(self._generators, self._seeds, strict=True) if self._generators else ()
        pairs = list(present) or [seeding.np_random() for _ in seeds]
        for k, seed in enumerate(seeds):
            if seed is not None:
                pairs[k] = seeding.np_random(int(seed))
        self._generators, self._seeds = tuple(pair[0] for pair in pairs), tuple(pair[1] for pair in pairs)

    def _begin(self, members: np.ndarray, observations: np.ndarray) -> None:
        """Start episodes of these vehicles, and write their observations."""
        own = self._generators
        if own is None:
            positions = starts(super().np_random, self._ground, len(members))
        else:
            positions = np.concatenate([starts(own[k], self._ground, 1) for k in members])
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
        self._vector_env.np_random = self.np_random
        observations, _ = self._vector_env.reset()
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
