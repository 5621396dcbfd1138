"""How a key of a scene varies from flight to flight: functions of a random generator."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

Distribution = Callable[[np.random.Generator], Any]


def normal(mean: float, deviation: float) -> Distribution:
    """A normal distribution with this mean and standard deviation."""
    return lambda generator: float(generator.normal(mean, deviation))


def uniform(low: float, high: float) -> Distribution:
    """A uniform distribution over [low, high)."""
    return lambda generator: float(generator.uniform(low, high))


def choice(*values: Any) -> Distribution:
    """One of these values, each as likely."""
    options: Sequence[Any] = values
    return lambda generator: options[int(generator.integers(len(options)))]
