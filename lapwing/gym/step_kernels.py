"""Compiled step of the environments: actions to setpoints, rewards and observations of the vehicles of a batch."""

from typing import NamedTuple

import numpy as np

from lapwing.dynamics import rate_control, vector
from lapwing.dynamics.lie import quaternion
from lapwing.dynamics.simd_batch import WIDTH
from lapwing.gym import tasks
from lapwing.kernels import always_inline, kernel, math

RATES = (6.0, 6.0, 2.0)  # [rad/s] body rates at an action of 1
WAY, SPEED, SPIN = 50.0, 50.0, 50.0  # [m], [m/s], [rad/s] saturation of observations
BOUNDS = np.array([WAY] * 6 + [SPEED] * 3 + [1.0] * 9 + [SPIN] * 3, np.float32)  # of observations, either sign


class Vehicles(NamedTuple):
    """Memory of a `BatchSimulator` of n vehicles."""

    memory: np.ndarray  # memory of `simd_batch.blocks`, flat
    columns: int  # number of columns of a block
    ticks: np.ndarray  # [ticks] since the last reset
    valid: np.ndarray  # bool
    interval: float  # [s] of a tick
    ground: float  # [m] height of a vehicle at rest


class Episodes(NamedTuple):
    """Data of n episodes, in addition to the state of the vehicles."""

    gates: np.ndarray  # number of gates passed, int, shape (n,)
    over: np.ndarray  # True if the next step restarts the episode, bool, shape (n,)
    before: np.ndarray  # position [m] and velocity [m/s], world, before a step; shape (n, 6)


class Results(NamedTuple):
    """Outputs of a step, shape (n, ...)."""

    observations: np.ndarray  # float32, shape (n, 21)
    reward: np.ndarray
    terminated: np.ndarray  # bool
    truncated: np.ndarray  # bool


@kernel
def read_actions(actions: np.ndarray, weight: float, setpoints: np.ndarray) -> bool:
    """Write thrust [N] and body rates [rad/s] of actions clipped to [-1, 1]. Return False if one is not finite.

    Args:
        actions: shape (n, 4).
        weight: weight of the vehicle [N].
        setpoints: shape (members, 4), changed; members after n repeat the last one.
    """
    for m in range(len(setpoints)):
        k = min(m, len(actions) - 1)
        for i in range(4):
            if not math.isfinite(actions[k, i]):
                return False
            action = min(max(actions[k, i], -1.0), 1.0)
            setpoints[m, i] = weight * (1.0 + action) if i == 0 else RATES[i - 1] * action
    return True


@always_inline
def _numbers(memory: np.ndarray, at: int, first: int) -> vector.Vec3:
    return (memory[at + first * WIDTH], memory[at + (first + 1) * WIDTH], memory[at + (first + 2) * WIDTH])


@always_inline
def _put(row: np.ndarray, at: int, value: float, bound: float) -> None:
    """Write a value clipped to +-bound, and -bound in place of NaN."""
    row[at] = bound if value > bound else (value if value >= -bound else -bound)


@kernel
def judge(task: tasks.Task, v: Vehicles, e: Episodes, r: Results, first: int, last: int) -> None:
    """Compute rewards, ends of episodes and observations of the blocks [first, last) after a step.

    Args:
        task: a Task.
        v: Vehicles.
        e: Episodes; `gates` and `before` are changed.
        r: Results, written.
        first: first block.
        last: last block (exclusive).
    """
    for m in range(first * WIDTH, min(last * WIDTH, len(e.over))):
        at = (m // WIDTH) * v.columns * WIDTH + m % WIDTH
        time = v.ticks[m] * v.interval
        goal = tasks.target(task.kind, time, e.gates[m], v.ground)
        position, velocity = _numbers(v.memory, at, 0), _numbers(v.memory, at, 7)
        x, y = v.memory[at + 4 * WIDTH], v.memory[at + 5 * WIDTH]
        b = e.before[m]
        reward, terminated, passed = tasks.judge(
            task.kind,
            goal,
            ((b[0], b[1], b[2]), (b[3], b[4], b[5])),
            position,
            velocity,
            1.0 - 2.0 * (x * x + y * y),
            rate_control.omega_body(v.memory, at, WIDTH),
            v.ground,
        )
        if not v.valid[m]:
            reward, terminated, passed = tasks.LOST, True, 0
        e.gates[m] += passed
        r.reward[m] = 0.0 if e.over[m] else reward
        r.terminated[m] = terminated and not e.over[m]
        r.truncated[m] = time >= task.seconds and not terminated and not e.over[m]
        observe(task, v, e, r.observations, m)


@kernel
def observe(task: tasks.Task, v: Vehicles, e: Episodes, observations: np.ndarray, m: int) -> None:
    """Write the observation of vehicle m, and store its position and velocity; see `judge`."""
    at = (m // WIDTH) * v.columns * WIDTH + m % WIDTH
    goal = tasks.target(task.kind, v.ticks[m] * v.interval, e.gates[m], v.ground)
    position, velocity = _numbers(v.memory, at, 0), _numbers(v.memory, at, 7)
    omega = rate_control.omega_body(v.memory, at, WIDTH)
    attitude = (v.memory[at + 3 * WIDTH], *_numbers(v.memory, at, 4))
    turned, row = quaternion.rotation_matrix(attitude), observations[m]
    for i in range(3):
        _put(row, i, goal.position_world[i] - position[i], WAY)
        _put(row, 3 + i, goal.ahead_world[i] - position[i], WAY)
        _put(row, 6 + i, velocity[i] - goal.velocity_world[i], SPEED)
        _put(row, 18 + i, omega[i], SPIN)
        e.before[m, i], e.before[m, 3 + i] = position[i], velocity[i]
    for i in range(9):
        _put(row, 9 + i, turned[i], 1.0)


@kernel
def observe_members(task: tasks.Task, v: Vehicles, e: Episodes, observations: np.ndarray, members: np.ndarray) -> None:
    """Write the observations of these vehicles; see `judge`."""
    for m in members:
        observe(task, v, e, observations, m)
