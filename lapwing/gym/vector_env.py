"""The environments: a `lapwing.BatchSimulator` under thrust and body rates, with a task."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from lapwing.batch_simulator import BatchSimulator, BatchState
from lapwing.cosim.scene import Overrides, Scene
from lapwing.gym.tasks import TASKS, Target
from lapwing.studies.campaign.distributions import Distribution

try:
    import gymnasium
    from gymnasium.spaces import Box
    from gymnasium.utils import seeding
    from gymnasium.vector import AutoresetMode, VectorEnv
    from gymnasium.vector.utils import batch_space
except ImportError:
    raise ImportError("lapwing.gym: Gymnasium is not installed; pip install lapwing[gym]") from None

RATE = 50.0  # [Hz] of the actions
RATES = np.array([6.0, 6.0, 2.0])  # [rad/s] about body x, y, z of an action of 1
NUMBERS = 21  # of an observation


class DroneVectorEnv(VectorEnv):
    """n vehicles of a scene with one task.

    An action is (thrust, rates about body x, y, z), each from -1 to 1: no thrust to twice the weight; 6, 6 and 2 rad/s.
    An observation is the way to the target and to the one after it [m], the velocity past the target [m/s], all in the
    world frame; the rotation matrix body to world, row by row; and the body rates [rad/s]. An episode that is over
    begins anew with the next step.
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
        """Environments.

        Args:
            num_envs: how many.
            task: one of `TASKS`.
            scene: whose vehicle and physics.
            overrides: as of `lapwing.load_scene`.
            vary: how keys of the scene vary from vehicle to vehicle.
            render_mode: none is known.

        Raises:
            ValueError: unknown task.
            SceneError: the scene is not sound.
        """
        if task not in TASKS:
            raise ValueError(f"task: expected one of {', '.join(TASKS)}, got {task!r}")
        self.task, self.num_envs, self.render_mode = TASKS[task](), num_envs, render_mode
        self.batch = BatchSimulator(scene, num_envs, vary, overrides)
        self._ticks = max(1, round(1.0 / (RATE * self.batch.interval)))
        self._ground = float(self.batch.state.position_world[0, 2])
        self.single_action_space = Box(-1.0, 1.0, (4,), np.float32)
        self.single_observation_space = Box(-np.inf, np.inf, (NUMBERS,), np.float32)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self._over, self._memory = np.zeros(num_envs, bool), np.zeros((num_envs, 1))

    def reset(self, *, seed: int | None = None, options: dict | None = None) -> tuple[np.ndarray, dict]:
        """Begin an episode with every vehicle."""
        if seed is not None:
            self._np_random, self._np_random_seed = seeding.np_random(seed)
        state = self._begin(np.arange(self.num_envs))
        self._over[:] = False
        return self._observed(state, self._target(state)), {}

    def step(self, actions: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, dict]:
        """Go on by 20 ms; episodes that were over begin anew instead."""
        asked = np.clip(np.asarray(actions, float).reshape(self.num_envs, 4), -1.0, 1.0)
        before = self.batch.state
        thrust, rates = self.batch.weight * (1.0 + asked[:, 0]), RATES * asked[:, 1:]
        now = self.batch.step(thrust=thrust, body_rates=rates, ticks=self._ticks)
        judged = self.task.judge(before, now, self._target(now), self._memory, self._ground)
        late = (now.time >= self.task.seconds) & ~judged.terminated
        terminated, reward = judged.terminated & ~self._over, np.where(self._over, 0.0, judged.reward)
        truncated = late & ~self._over
        if self._over.any():
            now = self._begin(np.flatnonzero(self._over))
        self._over = terminated | truncated
        return self._observed(now, self._target(now)), reward, terminated, truncated, {}

    def _begin(self, members: np.ndarray) -> BatchState:
        start, self._memory[members] = self.task.begin(self.np_random, self._ground, len(members))
        return self.batch.reset(members, position_world=start, rotor_speed=self.batch.hover_speed)

    def _target(self, state: BatchState) -> Target:
        return self.task.target(state.time, self._memory, self._ground)

    def _observed(self, state: BatchState, target: Target) -> np.ndarray:
        ways = [target.position_world - state.position_world, target.ahead_world - state.position_world]
        past = state.velocity_world - target.velocity_world
        return np.column_stack([*ways, past, _matrices(state.attitude), state.omega_body]).astype(np.float32)


class DroneEnv(gymnasium.Env):
    """One vehicle; otherwise as `DroneVectorEnv`, whose arguments but the first it takes."""

    metadata: dict[str, Any] = {"render_modes": []}  # noqa: RUF012

    def __init__(self, render_mode: None = None, **given: Any):
        self.render_mode, self._all = render_mode, DroneVectorEnv(1, **given)
        self.action_space = self._all.single_action_space
        self.observation_space = self._all.single_observation_space

    def reset(self, *, seed: int | None = None, options: dict | None = None) -> tuple[np.ndarray, dict]:
        """Begin an episode."""
        super().reset(seed=seed)
        observed, _ = self._all.reset(seed=seed)
        return observed[0], {}

    def step(self, action: Any) -> tuple[np.ndarray, float, bool, bool, dict]:
        """Go on by 20 ms."""
        observed, reward, terminated, truncated, _ = self._all.step(np.asarray(action)[None])
        return observed[0], float(reward[0]), bool(terminated[0]), bool(truncated[0]), {}


def _matrices(wxyz: np.ndarray) -> np.ndarray:
    """Rotation matrices body to world of unit quaternions (n, 4), row by row, shape (n, 9)."""
    w, x, y, z = wxyz.T
    rows = (
        (1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
        (2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
        (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
    )
    return np.column_stack([number for row in rows for number in row])


for _task in TASKS:
    gymnasium.register(
        f"lapwing/{_task}-v0",
        entry_point="lapwing.gym:DroneEnv",
        vector_entry_point="lapwing.gym:DroneVectorEnv",
        kwargs={"task": _task},
    )
