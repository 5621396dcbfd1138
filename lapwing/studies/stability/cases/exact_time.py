"""Case 17, short variant: error of the clock after a day."""

from fractions import Fraction

import numpy as np

from lapwing.services.scene_resolver import load, resolve
from lapwing.studies.stability.case_result import CaseResult, Curve, Plot, Row

HARD = "24 h at 250 Hz, 21.6 million communication steps: a sum of intervals accumulates round-off"

HOURS = 24


def run() -> CaseResult:
    """Compare integer ticks with a sum of intervals."""
    config = resolve(load("hover", []))
    per_hour = 3600 * 1_000_000_000 // config.interval_ns
    ticks = per_hour * np.arange(1, HOURS + 1)
    exact = [Fraction(int(tick) * config.interval_ns, 1_000_000_000) for tick in ticks]
    ours = np.array([abs(float(Fraction(float(t * config.interval)) - e)) for t, e in zip(ticks, exact, strict=True)])
    summed = np.add.accumulate(np.full(ticks[-1], config.interval))[ticks - 1]
    baseline = np.array([abs(float(Fraction(float(t)) - e)) for t, e in zip(summed, exact, strict=True)])
    row = Row("clock", "integer ticks of integer nanoseconds", "error of the time [s] after 24 h", 1e-11,
              "half a unit in the last place of 86 400 s as a float; time stamps are exact integers", float(ours.max()),
              "a sum of intervals", float(baseline.max()))  # fmt: skip
    hours = np.arange(1.0, HOURS + 1)
    curves = [Curve("ticks", hours, np.maximum(ours, 1e-17)), Curve("sum", hours, baseline)]
    return CaseResult([row], Plot("simulated time [h]", "error of the clock [s]", curves, row.bound))
