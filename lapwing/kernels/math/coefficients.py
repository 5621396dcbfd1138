"""Computation of the tables and polynomial coefficients of `lapwing.kernels.math`, written to `_tables.py`.

Run `python -m lapwing.kernels.math.coefficients` after a change; needs mpmath. A test compares file and result.

Polynomials are minimax approximations by the exchange algorithm of Remez (Muller, "Elementary Functions: Algorithms and
Implementation", 3rd edition, Birkhaeuser 2016, chapter 3). Tables hold each value as the sum of two doubles; where a
table value is multiplied by an argument, its first part has 26 bits, so that the product with another number of 26 bits
is exact (Dekker, "A floating-point technique for extending the available precision", Numer. Math. 18, 1971).
"""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from mpmath import mp, mpf

TARGET = Path(__file__).with_name("_tables.py")

SINE_STEPS = 128  # table points in a full turn
EXP_STEPS = 64  # table points between 1 and 2
LOG_STEPS = 128  # table points in an octave
LOG_START = 0.6875  # where the octave of mantissas begins
ATAN_STEPS = 64  # table points between 0 and 1
LIMB = 24  # [bits] of a limb of 1 / (2 pi)
LIMBS = 58


def round_to_bits(value: Any, bits: int) -> float:
    """Return a real number rounded to some bits, as a double."""
    if value == 0:
        return 0.0
    exponent = int(mp.floor(mp.log(abs(value), 2))) + 1 - bits
    return float(mp.nint(value / mpf(2) ** exponent) * mpf(2) ** exponent)


def parts(value: Any, *bits: int) -> list[float]:
    """Return a real number as the sum of doubles of so many bits, the largest first."""
    result = []
    for count in bits:
        result.append(round_to_bits(value, count))
        value = value - mpf(result[-1])
    return result


def _polynomial(coefficients: Sequence[Any], x: Any) -> Any:
    """Return the value of a polynomial, constant term first."""
    value = mpf(0)
    for coefficient in reversed(coefficients):
        value = value * x + coefficient
    return value


def remez(function: Callable[[Any], Any], count: int, low: Any, high: Any) -> list[float]:
    """Return the coefficients of the polynomial of least greatest error, constant term first.

    Args:
        function: continuous on [low, high].
        count: number of coefficients.
        low: lower end of the interval.
        high: upper end of the interval.
    """
    points = [(low + high) / 2 - (high - low) / 2 * mp.cos(mp.pi * i / count) for i in range(count + 1)]
    samples = [low + (high - low) * i / 800 for i in range(801)]
    values = [function(x) for x in samples]
    coefficients: Any = None
    for _ in range(12):
        matrix = mp.matrix([[x**k for k in range(count)] + [(-1) ** i] for i, x in enumerate(points)])
        solution = mp.lu_solve(matrix, mp.matrix([function(x) for x in points]))
        coefficients, level = list(solution[:count]), abs(solution[count])
        errors = [value - _polynomial(coefficients, x) for x, value in zip(samples, values, strict=True)]
        points, worst = _extremes(samples, errors, count + 1)
        if worst <= level * (1 + mpf("1e-3")):
            break
    return [float(c) for c in coefficients]


def _extremes(samples: Sequence[Any], errors: Sequence[Any], count: int) -> tuple[list[Any], Any]:
    """Return `count` samples where the error is greatest and changes its sign, and the greatest error."""
    best: list[tuple[Any, Any]] = []
    for x, error in zip(samples, errors, strict=True):
        if best and (error > 0) == (best[-1][1] > 0):
            if abs(error) > abs(best[-1][1]):
                best[-1] = (x, error)
        else:
            best.append((x, error))
    while len(best) > count:
        best.pop(0 if abs(best[0][1]) < abs(best[-1][1]) else -1)
    return [x for x, _ in best], max(abs(error) for error in errors)


def _remainder(function: Callable[[Any], Any], first: int, count: int) -> Callable[[Any], Any]:
    """Return the Taylor series of a function about 0 without its first terms, divided by x**first."""
    terms = mp.taylor(function, 0, first + count + 14)[first:]
    return lambda x: _polynomial(terms, x)


def sine_tables() -> dict[str, list]:
    """Return sine and cosine at multiples of a 128th of a turn, and the polynomials between them."""
    table = []
    for j in range(SINE_STEPS):
        for function in (mp.sinpi, mp.cospi):
            table += parts(function(mpf(2 * j) / SINE_STEPS), 26, 53)
    largest = (mp.pi / SINE_STEPS) ** 2 * mpf("1.001")
    sine = [(-1) ** k / mp.factorial(2 * k + 1) for k in range(1, 12)]
    cosine = [(-1) ** k / mp.factorial(2 * k) for k in range(2, 13)]
    step = 2 * mp.pi / SINE_STEPS
    return {
        "SINES": table,
        "SINE": remez(lambda z: _polynomial(sine, z), 3, mpf(0), largest),
        "COSINE": remez(lambda z: _polynomial(cosine, z), 3, mpf(0), largest),
        "STEP_PARTS": parts(step, 32, 32, 32, 53),
        "STEPS_PER_RADIAN": [float(1 / step)],
        "TURN_PARTS": parts(2 * mp.pi, 53, 53),
        "TURN_LIMBS": _limbs(1 / (2 * mp.pi)),
    }


def _limbs(value: Any) -> list[int]:
    """Return the binary places of a number in (0, 1), after three limbs of zeros."""
    whole = int(mp.floor(value * mpf(2) ** (LIMB * LIMBS)))
    limbs = [(whole >> (LIMB * (LIMBS - 1 - i))) & ((1 << LIMB) - 1) for i in range(LIMBS)]
    return [0, 0, 0, *limbs]


def exp_tables() -> dict[str, list]:
    """Return 2**(j/64) and the polynomial between."""
    table: list[float] = []
    for j in range(EXP_STEPS):
        table += parts(mpf(2) ** (mpf(j) / EXP_STEPS), 26, 53)
    reach = mp.log(2) / (2 * EXP_STEPS) * mpf("1.001")
    step = mp.log(2) / EXP_STEPS
    return {
        "POWERS": table,
        "EXP": remez(_remainder(mp.exp, 3, 5), 5, -reach, reach),
        "LN2_STEP_PARTS": parts(step, 32, 53),
        "STEPS_PER_LN2": [float(1 / step)],
    }


def log_tables() -> dict[str, list]:
    """Return short reciprocals of mantissas, the logarithms of the reciprocals, and the polynomial between."""
    table: list[float] = []
    start = mpf(LOG_START)
    lowest, highest = mpf(0), mpf(0)
    low = start
    for _ in range(LOG_STEPS):
        width = mpf(2) ** -8 if low < 1 else mpf(2) ** -7
        high = low + width
        short = mpf(1) if low <= 1 <= high else mpf(round_to_bits(2 / (low + high), 12))
        lowest, highest = min(lowest, low * short - 1), max(highest, high * short - 1)
        scale = mpf(2) ** 42
        first = mp.nint(-mp.log(short) * scale) / scale
        table += [float(short), float(first), float(-mp.log(short) - first)]
        low = high
    ln2 = mp.nint(mp.log(2) * mpf(2) ** 42) / mpf(2) ** 42
    assert low == 2 * start
    return {
        "LOG_START": [LOG_START],
        "LOGS": table,
        "LOG": remez(_remainder(lambda x: mp.log(1 + x), 3, 7), 7, lowest, highest),
        "LN2_PARTS": [float(ln2), float(mp.log(2) - ln2)],
    }


def other_tables() -> dict[str, list]:
    """Return arc tangents of j/64 with the polynomial between, and a first guess of the cube root on [1, 8]."""
    table: list[float] = []
    for j in range(ATAN_STEPS + 1):
        table += parts(mp.atan(mpf(j) / ATAN_STEPS), 53, 53)
    series = [mpf((-1) ** k) / (2 * k + 1) for k in range(1, 14)]
    reach = (mpf(1) / (2 * ATAN_STEPS)) ** 2 * mpf("1.01")
    return {
        "ATANS": table,
        "ATAN": remez(lambda z: _polynomial(series, z), 4, mpf(0), reach),
        "QUARTER_PARTS": parts(mp.pi / 2, 53, 53),
        "HALF_PARTS": parts(mp.pi, 53, 53),
        "CUBE_ROOT": remez(mp.cbrt, 6, mpf(1), mpf(8)),
    }


def text() -> str:
    """Return the source of `_tables.py`."""
    lines = ['"""Constants written by `coefficients`: do not edit."""', "", "# fmt: off"]
    with mp.workprec(1600):
        tables = sine_tables() | exp_tables() | log_tables() | other_tables()
    for name, values in tables.items():
        if len(values) == 1:
            lines.append(f"{name} = {values[0]!r}")
            continue
        lines.append(f"{name} = (")
        line = "   "
        for value in values:
            if len(line) + len(repr(value)) > 117:
                lines.append(line)
                line = "   "
            line += f" {value!r},"
        lines += [line, ")"]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    TARGET.write_text(text())
