"""Tasks of the environments: targets, rewards and ends of episodes, compiled.

A task is a kind with a duration; `target` and `judge` have a branch for each kind, so that one compiled loop serves all
tasks.
"""

from typing import NamedTuple

import numpy as np

from lapwing.dynamics import vector
from lapwing.kernels import kernel, math

HOVER, TRACK, LAND, RACE = range(4)
HIGH = 5.0  # [m] height above the ground at the start of an episode
FAR = 6.0  # [m] distance from the target at which an episode fails
FARTHEST = (FAR, FAR, HIGH + FAR, 4.0 * FAR)  # [m] largest distance from the target, by kind
LOST = -10.0  # reward
SOFT = 1.0  # [m/s] speed of a landing
LOW = 0.02  # [m] above the height at rest, below which a vehicle is on the ground
TRACK_RATE, TRACK_AHEAD = 2.0 * math.pi / 12.0, 0.5  # [rad/s] one round in 12 s; [s] look-ahead
TRACK_X, TRACK_Y = 4.0, 2.0  # [m] half of the length and width of the figure of eight
GATE_SIDE, GATE_RISE, GATE_WIDTH = 5.0, 1.5, 1.0  # [m] half of the square; rise of every other gate; width of a gate


class Task(NamedTuple):
    """Goal of an episode."""

    kind: int
    seconds: float  # [s] duration of an episode


TASKS = {
    "Hover": Task(HOVER, 10.0),  # stay 5 m above the ground, from a start up to 2 m away
    "Track": Task(TRACK, 15.0),  # follow a figure of eight, 8 m long, at up to 3 m/s
    "Land": Task(LAND, 10.0),  # touch down softly at the origin
    "Race": Task(RACE, 20.0),  # through four gates on a square of 10 m, as fast as possible
}


class Target(NamedTuple):
    """Target of a vehicle, world frame."""

    position_world: vector.Vec3  # [m]
    velocity_world: vector.Vec3  # [m/s]
    ahead_world: vector.Vec3  # [m] position after it


def starts(random: np.random.Generator, ground: float, n: int) -> np.ndarray:
    """Return start positions [m] of n episodes, shape (n, 3); `ground` is the height of a vehicle at rest [m]."""
    return np.array([0.0, 0.0, ground + HIGH]) + random.uniform(-1.0, 1.0, (n, 3)) * np.array([1.5, 1.5, 1.0])


@kernel
def target(kind: int, time: float, gate: int, ground: float) -> Target:
    """Return the target of a vehicle.

    Args:
        kind: kind of the task.
        time: time of the episode [s].
        gate: number of gates passed.
        ground: height of a vehicle at rest [m].
    """
    zero = (0.0, 0.0, 0.0)
    if kind == LAND:
        return Target((0.0, 0.0, ground), zero, (0.0, 0.0, ground))
    height = ground + HIGH
    if kind == TRACK:
        a, b = TRACK_RATE * time, TRACK_RATE * (time + TRACK_AHEAD)
        velocity = (TRACK_RATE * TRACK_X * math.cos(a), 2.0 * TRACK_RATE * TRACK_Y * math.cos(2.0 * a), 0.0)
        ahead = (TRACK_X * math.sin(b), TRACK_Y * math.sin(2.0 * b), height)
        return Target((TRACK_X * math.sin(a), TRACK_Y * math.sin(2.0 * a), height), velocity, ahead)
    if kind == RACE:
        return Target(_gate(gate, height), zero, _gate(gate + 1, height))
    return Target((0.0, 0.0, height), zero, (0.0, 0.0, height))


@kernel
def _gate(number: int, height: float) -> vector.Vec3:
    k = number % 4
    x = GATE_SIDE if k == 0 or k == 3 else -GATE_SIDE
    y = GATE_SIDE if k < 2 else -GATE_SIDE
    return (x, y, height + GATE_RISE * (k % 2))


@kernel
def judge(
    kind: int,
    goal: Target,
    before: tuple[vector.Vec3, vector.Vec3],
    position: vector.Vec3,
    velocity: vector.Vec3,
    upright: float,
    omega_body: vector.Vec3,
    ground: float,
) -> tuple[float, bool, int]:
    """Return (reward, True if the episode is over, gates passed) of a step of one vehicle.

    Hover and Track reward a small distance to the target at low rates. Land and Race reward the decrease of the
    distance; Land also a soft, upright and precise touch-down, Race every gate.

    Args:
        kind: kind of the task.
        goal: a Target.
        before: (position [m], velocity [m/s]) before the step, world.
        position: position [m], world.
        velocity: velocity [m/s], world.
        upright: cosine of the tilt.
        omega_body: body rates [rad/s].
        ground: height of a vehicle at rest [m].
    """
    away = vector.norm(vector.subtract(goal.position_world, position))
    nearer = vector.norm(vector.subtract(goal.position_world, before[0])) - away
    down, far = position[2] < ground + LOW, away > FARTHEST[kind]
    if kind == LAND:
        soft = down and vector.norm(before[1]) < SOFT and upright > 0.9
        reward = nearer + (10.0 * math.exp(-away) if soft else 0.0)
        return (reward + LOST if far or (down and not soft) else reward), down or far, 0
    if kind == RACE:
        through = 1 if away < GATE_WIDTH else 0
        return (LOST if far or down else nearer + 10.0 * through), far or down, through
    slip = vector.norm(vector.subtract(velocity, goal.velocity_world))
    quiet = math.exp(-away) - 0.05 * math.tanh(slip) - 0.02 * math.tanh(vector.norm(omega_body))
    lost = far or down or upright < 0.0
    return (LOST if lost else quiet), lost, 0
