"""Motor saturation: motors at a voltage limit in the air."""

import functools
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from lapwing.flights.topic_view import TopicView
from lapwing.flights.tracking import plain, strided_view
from lapwing.kernels import kernel

NEAR = 1e-6  # distance from a limit that counts as at it, relative to the maximum voltage
GAP = 1.0  # [s] shorter gaps do not separate two intervals


class Saturation(NamedTuple):
    """Motors at a voltage limit while the vehicle is in the air."""

    low: np.ndarray  # True at 0 V, shape (n, motors)
    high: np.ndarray  # True at the maximum voltage, shape (n, motors)
    step: np.ndarray  # [s] duration of each row, shape (n,)
    flying: np.ndarray  # True if armed and off the ground, shape (n,)

    @property
    def any(self) -> np.ndarray:
        """True where any motor is at a limit, shape (n,)."""
        at_limit = self.low | self.high
        return functools.reduce(np.logical_or, at_limit.T) if at_limit.any() else np.zeros(len(at_limit), bool)

    @property
    def lasted(self) -> float:
        """Total time with a motor at a limit [s]."""
        return float(self.step[self.any].sum())

    def share(self, seconds: float) -> float:
        """Return a duration [s] as a share of the time in the air."""
        return seconds / max(float(self.step[self.flying].sum()), 1e-9)


def highest_voltage(scene: Mapping[str, Any]) -> float | None:
    """Return the highest motor voltage [V] of a scene's tables; None if it has none."""
    return scene.get("airframe", {}).get("motor", {}).get("max_voltage")


def saturation(truth: TopicView, armed: np.ndarray, highest: float) -> Saturation:
    """Return the motors at 0 V or at the `highest` voltage while the vehicle is in the air.

    Args:
        truth: true state, n or more messages.
        armed: True where the motors are armed, shape (n,).
        highest: maximum voltage of a motor [V].
    """
    n = len(armed)
    voltage, t = truth.motor_voltage[:n], truth.times[:n]
    flying = armed & ~truth.ground_contact[:n]
    step = np.diff(t, append=t[-1]) if n else np.empty(0)
    return Saturation(*limits(voltage, flying, highest), step, flying)


def limits(voltage: np.ndarray, flying: np.ndarray, highest: float) -> tuple[np.ndarray, np.ndarray]:
    """Return True for the motors at 0 V and at the `highest` voltage [V], shapes (n, motors), where `flying`, (n,)."""
    low, high = np.empty(voltage.shape, bool), np.empty(voltage.shape, bool)
    _limits(low, high, strided_view(voltage), plain(flying, bool), NEAR * highest, (1.0 - NEAR) * highest)
    return low, high


@kernel
def _limits(low: Any, high: Any, voltage: Any, flying: Any, least: float, most: float) -> None:
    for row in range(voltage.shape[0]):
        for k in range(voltage.shape[1]):
            low[row, k] = flying[row] and voltage[row, k] < least
            high[row, k] = flying[row] and voltage[row, k] > most


def description(low: np.ndarray, high: np.ndarray, highest: float) -> str:
    """Return the motors at each limit by their flags, shape (n, motors), as text: "motor 2 at the limit of 40 V"."""
    limits = ((low, "0 V"), (high, f"{highest:g} V"))
    found = [(_motors(np.asarray(at.any(axis=0))), limit) for at, limit in limits if at.any()]
    if len(found) == 2 and found[0][0] == found[1][0]:
        return f"{found[0][0]} at the limit of {found[0][1]} or {found[1][1]}"
    return ", ".join(f"{motors} at the limit of {limit}" for motors, limit in found)


def spans(result: Saturation, t: np.ndarray, highest: float) -> list[tuple[str, float, float]]:
    """Return each interval with a motor at a limit: its text with time and share, start and end [s]."""
    listed, at_limit = [], result.any
    for start, stop in intervals(at_limit, t):
        rows = slice(start, stop)
        lasted = float(result.step[rows][at_limit[rows]].sum())
        motors = description(result.low[rows], result.high[rows], highest)
        text = f"{motors} for {lasted:.2f} s, {percent(result.share(lasted))} of the time in the air"
        listed.append((text, float(t[start]), float(t[min(stop, len(t) - 1)])))
    return listed


def percent(share: float) -> str:
    """Return a share, 0..1, in percent with two digits: "0.49 %", "100 %"."""
    return f"{float(f'{100.0 * share:.2g}'):g} %"


def _motors(affected: np.ndarray) -> str:
    numbers = np.flatnonzero(affected) + 1
    if len(numbers) == len(affected) > 1:
        return "all motors"
    return f"motor{'s' if len(numbers) > 1 else ''} {', '.join(map(str, numbers))}"


def intervals(where: np.ndarray, t: np.ndarray) -> list[tuple[int, int]]:
    """Return the rows (first, stop) of the intervals where `where` is True; gaps shorter than GAP are closed."""
    edges = np.diff(where.astype(np.int8), prepend=0, append=0)
    merged: list[tuple[int, int]] = []
    for start, stop in zip(np.flatnonzero(edges == 1).tolist(), np.flatnonzero(edges == -1).tolist(), strict=True):
        if merged and t[start] - t[merged[-1][1] - 1] < GAP:
            merged[-1] = merged[-1][0], stop
        else:
            merged.append((start, stop))
    return merged
