"""What the environments ask for: where to be, what is rewarded, and when an episode ends. Arrays of n members."""

from typing import NamedTuple

import numpy as np

from lapwing.batch_simulator import BatchState

HIGH = 5.0  # [m] above the ground, where most episodes begin
FAR = 6.0  # [m] from the target: the episode is lost
LOST = -10.0  # reward
SOFT = 1.0  # [m/s] of a landing


class Target(NamedTuple):
    """Where a member ought to be, shape (n, 3) each."""

    position_world: np.ndarray  # [m]
    velocity_world: np.ndarray  # [m/s]
    ahead_world: np.ndarray  # [m] where it ought to be next


class Judged(NamedTuple):
    """What a step was worth, shape (n,) each."""

    reward: np.ndarray
    terminated: np.ndarray  # of bool


class Hover:
    """Stay where it is asked to, from a start up to 2 m away."""

    seconds = 10.0  # of an episode

    def begin(self, random: np.random.Generator, ground: float, n: int) -> tuple[np.ndarray, np.ndarray]:
        """(start positions (n, 3) [m], what the task remembers of each (n, k)) of episodes that begin."""
        return _around(random, np.array([0.0, 0.0, ground + HIGH]), n), np.zeros((n, 1))

    def target(self, time: np.ndarray, memory: np.ndarray, ground: float) -> Target:
        """Where every vehicle ought to be at these times [s] of the episodes, shape (n,)."""
        place = np.tile([0.0, 0.0, ground + HIGH], (len(time), 1))
        return Target(place, np.zeros_like(place), place)

    def judge(self, before: BatchState, now: BatchState, target: Target, memory: np.ndarray, ground: float) -> Judged:
        """What the last step was worth; may change `memory`."""
        return _tracking(now, target, ground)


class Track(Hover):
    """Follow a figure of eight, 8 m long, at up to 3 m/s."""

    seconds, period, ahead = 15.0, 12.0, 0.5  # [s]
    half = np.array([4.0, 2.0, 0.0])  # [m]

    def target(self, time: np.ndarray, memory: np.ndarray, ground: float) -> Target:
        """The points of the figure of eight at these times [s] of the episodes, shape (n,)."""
        place, speed = self._at(time, ground)
        return Target(place, speed, self._at(time + self.ahead, ground)[0])

    def _at(self, time: np.ndarray, ground: float) -> tuple[np.ndarray, np.ndarray]:
        rate = 2.0 * np.pi / self.period
        zero = np.zeros_like(time)
        place = self.half * np.column_stack([np.sin(rate * time), np.sin(2.0 * rate * time), zero])
        speed = rate * self.half * np.column_stack([np.cos(rate * time), 2.0 * np.cos(2.0 * rate * time), zero])
        return place + np.array([0.0, 0.0, ground + HIGH]), speed


class Land(Hover):
    """Touch down softly at the origin."""

    def target(self, time: np.ndarray, memory: np.ndarray, ground: float) -> Target:
        """The origin on the ground, for every vehicle."""
        place = np.tile([0.0, 0.0, ground], (len(time), 1))
        return Target(place, np.zeros_like(place), place)

    def judge(self, before: BatchState, now: BatchState, target: Target, memory: np.ndarray, ground: float) -> Judged:
        """Rewards what brings it nearer, a soft and upright touch-down, and its precision."""
        nearer = _distance(before.position_world, target) - _distance(now.position_world, target)
        down = now.position_world[:, 2] < ground + 0.02
        soft = (np.linalg.norm(before.velocity_world, axis=1) < SOFT) & (upright(now) > 0.9)
        precise = 10.0 * np.exp(-_distance(now.position_world, target))
        lost = _distance(now.position_world, target) > HIGH + FAR
        reward = nearer + np.where(down & soft, precise, 0.0) + np.where((down & ~soft) | lost, LOST, 0.0)
        return Judged(reward, down | lost)


class Race(Hover):
    """Through four gates on a square of 10 m, one after the other, as fast as it goes."""

    seconds, wide = 20.0, 1.0  # [s]; [m] from the middle of a gate: through it
    gates = np.array([[5.0, 5.0, 0.0], [-5.0, 5.0, 1.5], [-5.0, -5.0, 0.0], [5.0, -5.0, 1.5]])  # [m] above HIGH

    def target(self, time: np.ndarray, memory: np.ndarray, ground: float) -> Target:
        """The next gate, and the one after it."""
        high, next_gate = np.array([0.0, 0.0, ground + HIGH]), memory[:, 0].astype(int)
        place, after = (self.gates[(next_gate + k) % len(self.gates)] + high for k in (0, 1))
        return Target(place, np.zeros_like(place), after)

    def judge(self, before: BatchState, now: BatchState, target: Target, memory: np.ndarray, ground: float) -> Judged:
        """Rewards what brings it nearer to the gate, and every gate."""
        away = _distance(now.position_world, target)
        through = away < self.wide
        memory[:, 0] += through
        lost = (away > 4.0 * FAR) | (now.position_world[:, 2] < ground + 0.02)
        reward = _distance(before.position_world, target) - away + 10.0 * through
        return Judged(np.where(lost, LOST, reward), lost)


TASKS: dict[str, type[Hover]] = {"Hover": Hover, "Track": Track, "Land": Land, "Race": Race}


def upright(state: BatchState) -> np.ndarray:
    """Cosine of the tilt, shape (n,)."""
    return 1.0 - 2.0 * (state.attitude[:, 1] ** 2 + state.attitude[:, 2] ** 2)


def _tracking(now: BatchState, target: Target, ground: float) -> Judged:
    """1 for being there quietly, less with the distance; lost where it is far, upside down or on the ground."""
    away = _distance(now.position_world, target)
    slip = np.linalg.norm(now.velocity_world - target.velocity_world, axis=1)
    spin = np.linalg.norm(now.omega_body, axis=1)
    lost = (away > FAR) | (upright(now) < 0.0) | (now.position_world[:, 2] < ground + 0.02)
    return Judged(np.where(lost, LOST, np.exp(-away) - 0.05 * np.tanh(slip) - 0.02 * np.tanh(spin)), lost)


def _distance(position: np.ndarray, target: Target) -> np.ndarray:
    return np.linalg.norm(target.position_world - position, axis=1)


def _around(random: np.random.Generator, middle: np.ndarray, n: int) -> np.ndarray:
    return middle + random.uniform(-1.0, 1.0, (n, 3)) * np.array([1.5, 1.5, 1.0])
