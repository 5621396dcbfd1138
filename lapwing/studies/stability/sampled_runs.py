"""Sampled runs of any integrator on any system, and their errors."""

from typing import Any

import numpy as np

from lapwing.dynamics import integrators
from lapwing.kernels.state_tree import flatten
from lapwing.studies.accuracy.coordinates import coordinates
from lapwing.studies.accuracy.integrate import sample_states


def rows(method: str, p: Any, x: Any, duration: float, steps: int, samples: int) -> np.ndarray:
    """Return the states at `samples` equal parts of a run from time 0, shape (samples + 1, n).

    `duration` is in [s]; `steps` is a multiple of `samples`. Rows are NaN from the first non-finite one.
    """
    out = np.empty((samples + 1, len(flatten(x))))
    count = sample_states(integrators.get(method).Method(), p, x, duration / steps, steps // samples, out)
    out[count:] = np.nan
    return out


def run_fixed_steps(method: str, p: Any, x: Any, duration: float, steps: int, samples: int) -> np.ndarray:
    """Return `rows` with attitudes as matrices, shape (samples + 1, m)."""
    return coordinates(x, rows(method, p, x, duration, steps, samples))


def worst(values: np.ndarray) -> float:
    """Return the largest absolute value; NaN if any value is NaN, 0 for an empty array."""
    return float(np.abs(values).max()) if len(values) else 0.0


def drift(values: np.ndarray) -> np.ndarray:
    """Return the largest change of an invariant from its initial value, relative to that value, shape (k,)."""
    values = values.reshape(len(values), -1)
    return np.abs(values - values[0]).max(axis=1) / np.abs(values[0]).max()
