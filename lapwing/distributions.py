"""How a key of a scene varies from flight to flight: functions of a random generator."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

Distribution = Callable[[np.random.Generator], Any]


def normal(mean: float, deviation: float) -> Distribution:
    """A normal distribution with this mean and standard deviation, in the unit of the key.

    Raises:
        ValueError: the deviation is below 0.
    """
    if not deviation >= 0.0:
        raise ValueError(f"normal: expected a deviation of at least 0, got {deviation}")
    return lambda generator: float(generator.normal(mean, deviation))


def uniform(low: float, high: float) -> Distribution:
    """A uniform distribution over [low, high), in the unit of the key.

    Raises:
        ValueError: high is below low.
    """
    if not high >= low:
        raise ValueError(f"uniform: expected low <= high, got {low} and {high}")
    return lambda generator: float(generator.uniform(low, high))


def choice(*values: Any) -> Distribution:
    """One of these values, each as likely.

    Raises:
        ValueError: there are none.
    """
    if not values:
        raise ValueError("choice: expected at least one value")
    options: Sequence[Any] = values
    return lambda generator: options[int(generator.integers(len(options)))]
