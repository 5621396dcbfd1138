"""Errors of the elementary functions, measured against mpmath.

`python -m tests.kernels.math.accuracy` prints the table of docs/explanation/elementary_functions.md; needs mpmath.
"""

import math
import random
import sys
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

from mpmath import mp, mpf

from lapwing.kernels import math as functions

Arguments = tuple[float, ...]
Sampler = Callable[[random.Random], Arguments]


def _uniform(low: float, high: float) -> Sampler:
    return lambda rng: (rng.uniform(low, high),)


def _decades(low: float, high: float, *, signed: bool = True) -> Sampler:
    """Sample magnitudes whose logarithm is uniformly distributed."""
    return lambda rng: (math.exp(rng.uniform(math.log(low), math.log(high))) * (rng.choice((-1, 1)) if signed else 1),)


def _any(rng: random.Random) -> Arguments:
    """Sample all exponents of doubles, subnormal ones too."""
    return (math.ldexp(rng.uniform(1.0, 2.0), rng.randint(-1074, 1023)) * rng.choice((-1, 1)),)


def _positive(sampler: Sampler) -> Sampler:
    return lambda rng: tuple(map(abs, sampler(rng)))


def _pair(first: Sampler, second: Sampler) -> Sampler:
    return lambda rng: first(rng) + second(rng)


def _around_one(rng: random.Random) -> Arguments:
    return (1.0 + rng.choice((-1, 1)) * math.exp(rng.uniform(-36.0, -0.7)),)


def _below_one(rng: random.Random) -> Arguments:
    return (rng.choice((-1, 1)) * (1.0 - math.exp(rng.uniform(-36.0, -0.7))),)


def _near_quarter_turns(rng: random.Random) -> Arguments:
    """Sample the doubles nearest to multiples of pi/2 up to 1e22."""
    return (float(rng.randint(1, 10 ** rng.randint(1, 22)) * mp.pi / 2),)


def _one_size(rng: random.Random) -> Arguments:
    """Sample two numbers of about one size, which may be subnormal or near the largest double."""
    exponent = rng.randint(-1070, 1022)
    return math.ldexp(rng.uniform(-1.0, 1.0), exponent), math.ldexp(rng.uniform(-1.0, 1.0), exponent)


def _in_range(rng: random.Random) -> Arguments:
    """Sample powers between the smallest and the largest double."""
    (x,) = _positive(_any)(rng)
    return x, rng.uniform(-744.0, 709.0) / math.log(x)


_ANGLES = (_uniform(-8.0, 8.0), _decades(1e-10, 1.0), _decades(1.0, 65536.0), _any, _near_quarter_turns)
_UNIT = (_uniform(-1.0, 1.0), _decades(1e-10, 1.0), _below_one)
_SHORT = _uniform(-1.0, 1.0)

SAMPLERS: dict[str, tuple[Sampler, ...]] = {
    "sin": _ANGLES,
    "cos": _ANGLES,
    "tan": _ANGLES,
    "asin": _UNIT,
    "acos": _UNIT,
    "atan": (_uniform(-3.0, 3.0), _decades(1e-10, 1e10), _any),
    "atan2": (_pair(_SHORT, _SHORT), _pair(_any, _any), _pair(_decades(1e-3, 1e3), _decades(1e-3, 1e3)), _one_size),
    "exp": (_uniform(-10.0, 10.0), _decades(1e-10, 700.0), _uniform(-745.0, 709.7)),
    "expm1": (_uniform(-10.0, 10.0), _decades(1e-10, 700.0), _uniform(-0.1, 0.1)),
    "log": (_uniform(1e-3, 10.0), _positive(_any), _uniform(0.9, 1.1), _around_one),
    "log1p": (_uniform(-0.9, 10.0), _decades(1e-300, 1e300, signed=False), _uniform(-0.1, 0.1), _decades(1e-16, 0.9)),
    "pow": (
        _pair(_uniform(1e-3, 10.0), _uniform(-10.0, 10.0)), _in_range, _pair(_around_one, _uniform(-1e4, 1e4)),
        _pair(_uniform(1e-3, 100.0), lambda rng: (float(rng.randint(-20, 20)),)),
    ),
    "sqrt": (_positive(_any),),
    "cbrt": (_uniform(-10.0, 10.0), _any),
    "hypot": (_pair(_SHORT, _SHORT), _pair(_decades(1e-3, 1e3), _decades(1e-3, 1e3)), _one_size),
    "tanh": (_uniform(-10.0, 10.0), _decades(1e-10, 22.0), _uniform(-0.1, 0.1)),
}  # fmt: skip


def exact(name: str, *arguments: float) -> Any:
    """Return the value of a function to at least 150 bits."""
    if name in ("sin", "cos", "tan"):
        bits = 300 + max(0, math.frexp(arguments[0])[1])
    else:
        bits = 300
    with mp.workprec(bits):
        values = [mpf(x) for x in arguments]
        if name == "cbrt":
            return mp.sign(values[0]) * mp.cbrt(abs(values[0]))
        return (mp.power if name == "pow" else getattr(mp, name))(*values)


def error(value: float, reference: Any) -> float:
    """Return the error of a value in units in the last place of the double nearest to the reference."""
    nearest = abs(float(reference))
    place = mpf(math.ulp(nearest)) if nearest < math.inf else mpf(2) ** 971
    with mp.workprec(300):
        return float(abs(mpf(value) - reference) / place)


class Errors(NamedTuple):
    """Errors of one function over a sample."""

    worst: float  # [units in the last place]
    at: Arguments
    misrounded: float  # fraction of values that are not the double nearest to the exact one
    arguments: int  # number of them


def samples(name: str, count: int, seed: int) -> Iterator[Arguments]:
    """Return about `count` arguments from each sampler of a function."""
    rng = random.Random(f"{name} {seed}")
    return (sampler(rng) for sampler in SAMPLERS[name] for _ in range(count))


def measure(name: str, arguments: Iterator[Arguments] | Sequence[Arguments]) -> Errors:
    """Return the errors of a function over arguments whose values are finite."""
    function = getattr(functions, name)
    worst, misrounded, count = 0.0, 0, 0
    at: Arguments = (math.nan,)
    for each in arguments:
        reference = exact(name, *each)
        nearest, value = float(reference), function(*each)
        if math.isinf(nearest):
            continue
        count += 1
        misrounded += value != nearest
        current = error(value, reference)
        if not current <= worst:
            worst, at = current, each
    return Errors(worst, at, misrounded / max(count, 1), count)


def main(count: int = 20_000) -> None:
    """Print the table, with `count` arguments from each sampler."""
    print("| function | worst error [ulp] | at | correctly rounded | arguments |\n|---|---|---|---|---|")
    for name in SAMPLERS:
        result = measure(name, samples(name, count, 0))
        place = ", ".join(map(repr, result.at))
        print(
            f"| {name} | {result.worst:.4f} | {place} | {100 * (1 - result.misrounded):.3f} % | {result.arguments} |",
            flush=True,
        )


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
