"""Result of a stability case: rows with bounds, a plot, and the sweep of its difficulty."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np


class Curve(NamedTuple):
    """A line of a plot."""

    name: str
    x: np.ndarray  # (n,)
    y: np.ndarray  # (n,) NaN where not finite


class Plot(NamedTuple):
    """Lines over one axis."""

    x_label: str
    y_label: str
    curves: Sequence[Curve]
    bound: float | None = None  # a horizontal line
    log_x: bool = False
    log_y: bool = True


class Row(NamedTuple):
    """One result of a case: error of Lapwing's method and of a baseline method, and the bound of both."""

    name: str
    method: str
    invariant: str  # measured quantity, with its unit
    bound: float
    why: str  # reason for the bound
    measured: float
    baseline: str  # the baseline method
    baseline_measured: float

    @property
    def passes(self) -> bool:
        """True if Lapwing's method meets the bound; NaN does not."""
        return bool(self.measured <= self.bound)

    @property
    def baseline_passes(self) -> bool:
        """True if the baseline method meets the bound: then the row proves nothing."""
        return bool(self.baseline_measured <= self.bound)

    @property
    def is_conclusive(self) -> bool:
        """True if Lapwing's method meets the bound and the baseline method does not."""
        return self.passes and not self.baseline_passes


class CaseResult(NamedTuple):
    """Result of a case."""

    rows: Sequence[Row]
    plot: Plot


class Sweep(NamedTuple):
    """Error of each method over the difficulty."""

    difficulty: str  # label of the x axis, with its unit
    error: str  # label of the y axis
    bound: float
    curves: Sequence[Curve]  # one per method
    log_x: bool = True
    falling: bool = False  # True if small values are harder

    def breaks(self) -> dict[str, float | None]:
        """Return the first difficulty at which each method exceeds the bound; None if it never does."""
        result: dict[str, float | None] = {}
        for name, x, y in self.curves:
            order = np.argsort(x)[:: -1 if self.falling else 1]
            broken = order[~(np.asarray(y)[order] <= self.bound)]
            result[name] = float(x[broken[0]]) if len(broken) else None
        return result

    def plot(self) -> Plot:
        """Return the sweep as a plot."""
        return Plot(self.difficulty, self.error, self.curves, self.bound, self.log_x)
