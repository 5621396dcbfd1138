"""Coordinates of states for errors: plain columns of numbers, with attitudes as matrices."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from lapwing.dynamics.lie.quaternion import Quaternion
from lapwing.kernels.state_tree import flatten, normalise, unflatten


def matrices(q: np.ndarray) -> np.ndarray:
    """Return R_world_body, row-major, shape (k, 9), of quaternions wxyz, shape (k, 4)."""
    w, x, y, z = q.T
    return np.column_stack(
        [
            1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y),
            2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
            2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y),
        ]
    )  # fmt: skip


def _parts(x: Any) -> Iterator[bool]:
    """Yield True for each quaternion (four numbers) and False for each number of a state, in order."""
    if isinstance(x, Quaternion):
        yield True
    elif isinstance(x, tuple):
        for part in x:
            yield from _parts(part)
    else:
        yield False


def coordinates(x: Any, rows: np.ndarray) -> np.ndarray:
    """Return the coordinates, shape (k, m), of states like `x` with stored numbers `rows`: quaternions as matrices."""
    columns, at = [], 0
    for turned in _parts(x):
        columns.append(matrices(rows[:, at : at + 4]) if turned else rows[:, at : at + 1])
        at += 4 if turned else 1
    return np.hstack(columns)


def of_state(x: Any) -> np.ndarray:
    """Return the coordinates of one state, shape (n,)."""
    return coordinates(x, np.array([flatten(x)], dtype=float))[0]


def defect(x: Any, row: np.ndarray) -> float:
    """Return the distance of the state with the stored numbers `row` from its manifold."""
    state = unflatten(x, tuple(map(float, row)))
    return float(np.abs(np.array(flatten(normalise(state))) - row).max())


def error(end: np.ndarray, exact: np.ndarray) -> float:
    """Return the largest difference of coordinates, relative to 1 + their size."""
    return float((np.abs(end - exact) / (1.0 + np.abs(exact))).max())
