"""Distributions of varied scene keys, defined by their quantile functions.

Correlated keys share normal numbers: the quantile of one key follows from a weighted sum of those of several.
"""

import math
import re
import sys
import tomllib
from collections.abc import Callable, Mapping
from inspect import signature
from typing import Any, NamedTuple

import numpy as np
from scipy.special import ndtr, ndtri

from lapwing.cosim.scene.overrides import value_of
from lapwing.cosim.scene.toml_text import toml


class Distribution(NamedTuple):
    """Distribution of the values of a key; `str` returns the text that `parse` reads."""

    name: str
    arguments: tuple[Any, ...]
    weights: tuple[tuple[str, float], ...] = ()  # of the normal numbers of correlated keys, with a sum of squares of 1

    def __str__(self) -> str:
        arguments = [*self.arguments, *([dict(self.weights)] if self.weights else [])]
        return f"{self.name}({', '.join(map(toml, arguments))})"

    @property
    def values(self) -> tuple[Any, ...]:
        """Values of a discrete distribution, equally likely; () for a continuous one."""
        return _VALUES[self.name](*self.arguments) if self.name in _VALUES else ()

    def quantile(self, u: Mapping[str, float], key: str) -> float:
        """Return the number in (0, 1) for the value of this key, given independent ones of all keys."""
        if not self.weights:
            return u[key]
        return float(ndtr(sum(weight * ndtri(u[other]) for other, weight in self.weights)))

    def at(self, u: float) -> Any:
        """Return the quantile of u, 0 < u < 1."""
        if values := self.values:
            return values[min(int(u * len(values)), len(values) - 1)]
        return float(_QUANTILES[self.name](u, *self.arguments))


def normal(mean: float, deviation: float, weights: Mapping[str, float] | None = None) -> Distribution:
    """Return a normal distribution with this mean and standard deviation, in the unit of the key.

    Args:
        mean: mean.
        deviation: standard deviation.
        weights: weights of the normal numbers of correlated keys; see `lapwing.posterior`.

    Raises:
        ValueError: the deviation is below 0, or the weights are invalid.
    """
    result = _validate("normal", mean, deviation, valid=deviation >= 0.0, expected="a deviation of at least 0")
    return _weighted(result, weights)


def lognormal(mean: float, deviation: float, weights: Mapping[str, float] | None = None) -> Distribution:
    """Return a log-normal distribution with this mean and standard deviation; its values are positive. See `normal`.

    Raises:
        ValueError: the mean is not above 0, the deviation is below 0, or the weights are invalid.
    """
    valid, expected = mean > 0.0 and deviation >= 0.0, "a mean above 0 and a deviation of at least 0"
    return _weighted(_validate("lognormal", mean, deviation, valid=valid, expected=expected), weights)


def uniform(low: float, high: float) -> Distribution:
    """Return a uniform distribution over [low, high], in the unit of the key.

    Raises:
        ValueError: high is below low.
    """
    return _validate("uniform", low, high, valid=high >= low, expected="low <= high")


def loguniform(low: float, high: float) -> Distribution:
    """Return a log-uniform distribution: each decade between low and high is equally likely.

    Raises:
        ValueError: high is below low, or low is not above 0.
    """
    return _validate("loguniform", low, high, valid=high >= low > 0.0, expected="0 < low <= high")


def linspace(low: float, high: float, count: int) -> Distribution:
    """Return a distribution over `count` equidistant values from low to high, equally likely.

    Raises:
        ValueError: the count is not an integer from 1 to 1 000 000.
    """
    valid = isinstance(count, int) and 0 < count <= MAX_VALUES
    expected = f"a whole number of values, up to {MAX_VALUES}, as third argument"
    return _validate("linspace", low, high, count, valid=valid, expected=expected)


def choice(*values: Any) -> Distribution:
    """Return a distribution over these values, equally likely.

    Raises:
        ValueError: no value is given.
    """
    if not values:
        raise ValueError("choice: expected at least one value")
    return Distribution("choice", values)


KINDS: dict[str, Callable[..., Distribution]] = {
    f.__name__: f for f in (normal, lognormal, uniform, loguniform, linspace, choice)
}
_QUANTILES: dict[str, Callable[..., float]] = {
    "normal": lambda u, mean, deviation: mean + deviation * ndtri(u),
    "lognormal": lambda u, mean, deviation: math.exp(
        _log_mean(mean, deviation) + log_deviation(mean, deviation) * ndtri(u)
    ),
    "uniform": lambda u, low, high: low + u * (high - low),
    "loguniform": lambda u, low, high: low * (high / low) ** u,
}
_VALUES: dict[str, Callable[..., tuple]] = {
    "choice": lambda *values: values,
    "linspace": lambda low, high, count: tuple(np.linspace(low, high, count).tolist()),
}
MAX_VALUES = 1_000_000  # values of a linspace
_FORM = re.compile(r"(\w+)\s*\((.*)\)", re.DOTALL)
_SPLIT = re.compile(r"""((?:"[^"]*"|'[^']*'|\[[^\]]*\]|\{[^}]*\}|[^,])+)(?:,|$)""")


def parse(text: str) -> Distribution:
    """Return the distribution of a text: "normal(10.4, 0.2)", "choice(rtk, standard)".

    Raises:
        ValueError: the distribution is unknown, or its arguments are invalid.
    """
    match = _FORM.fullmatch(text.strip())
    if not match or match[1] not in KINDS:
        raise ValueError(f"expected a distribution ({', '.join(KINDS)}), for example normal(10.4, 0.2), got {text!r}")
    arguments = _arguments(match[2])
    try:
        return KINDS[match[1]](*arguments)
    except TypeError:
        names = ", ".join(name for name in signature(KINDS[match[1]]).parameters if name != "weights")
        raise ValueError(f"{match[1]}: got {match[2]!r}, expected {match[1]}({names}) with numbers") from None


def _arguments(text: str) -> list[Any]:
    """Parse comma-separated TOML values, including bare words. Raise ValueError for anything else."""
    try:
        return tomllib.loads(f"values = [{text}]")["values"]
    except tomllib.TOMLDecodeError:
        return [value_of(part.strip()) for part in _SPLIT.findall(text)]


def log_deviation(mean: float, deviation: float) -> float:
    """Return the standard deviation of the logarithm of a log-normal number with this mean and standard deviation."""
    return math.sqrt(math.log1p((deviation / mean) ** 2))


def _log_mean(mean: float, deviation: float) -> float:
    return math.log(mean) - 0.5 * log_deviation(mean, deviation) ** 2


def _weighted(distribution: Distribution, weights: Mapping[str, float] | None) -> Distribution:
    if not weights:
        return distribution
    if not abs(math.fsum(weight * weight for weight in weights.values()) - 1.0) < 1e-6:
        raise ValueError(f"{distribution.name}: expected weights whose squares have the sum 1")
    return distribution._replace(weights=tuple(weights.items()))


def _validate(name: str, *numbers: float, valid: bool, expected: str) -> Distribution:
    if not valid or not all(abs(number) <= sys.float_info.max for number in numbers):
        raise ValueError(f"{name}: expected {expected}, got {', '.join(map(str, numbers))}")
    return Distribution(name, numbers)
