"""When motors are at a limit of their voltage in the air."""

from typing import NamedTuple

import numpy as np

from studies.topic_view import TopicView

NEAR = 1e-6  # of the maximum voltage: nearer to a limit is at it
APART = 1.0  # [s] stretches that are nearer to each other are told as one


class Saturation(NamedTuple):
    """Where motors are at a limit while the vehicle flies."""

    low: np.ndarray  # at no voltage, shape (n, motors) of bool
    high: np.ndarray  # at the highest
    step: np.ndarray  # [s] of each row, shape (n,)
    flying: np.ndarray  # armed and off the ground, shape (n,) of bool

    @property
    def any(self) -> np.ndarray:
        """Whether any motor is at a limit, shape (n,)."""
        return (self.low | self.high).any(axis=1)

    @property
    def lasted(self) -> float:
        """In all [s]."""
        return float(self.step[self.any].sum())

    def share(self, seconds: float) -> float:
        """Of the time in the air."""
        return seconds / max(float(self.step[self.flying].sum()), 1e-9)


def saturation(truth: TopicView, armed: np.ndarray, highest: float) -> Saturation:
    """Where motors are at 0 or at the `highest` voltage [V] while the vehicle flies.

    Args:
        truth: of n or more messages.
        armed: shape (n,) of bool.
        highest: of each motor.
    """
    n = len(armed)
    voltage, t = truth.motor_voltage[:n], truth.times[:n]
    flying = armed & ~truth.ground_contact[:n]
    step = np.diff(t, append=t[-1]) if n else np.empty(0)
    low, high = voltage < NEAR * highest, voltage > (1.0 - NEAR) * highest
    return Saturation(low & flying[:, None], high & flying[:, None], step, flying)


def stretches(where: np.ndarray, t: np.ndarray) -> list[tuple[int, int]]:
    """Rows (first, one after the last) of stretches where something holds, those close to each other as one."""
    edges = np.diff(where.astype(np.int8), prepend=0, append=0)
    merged: list[tuple[int, int]] = []
    for start, stop in zip(np.flatnonzero(edges == 1).tolist(), np.flatnonzero(edges == -1).tolist(), strict=True):
        if merged and t[start] - t[merged[-1][1] - 1] < APART:
            merged[-1] = merged[-1][0], stop
        else:
            merged.append((start, stop))
    return merged
