"""Remaining time of work that consists of many equal parts."""

import time
from collections.abc import Callable


class TimeLeft:
    """Estimate of the remaining time, from the time that the later half of the finished work took.

    The first parts take longer (compilation, start of workers), so they count only until others have followed.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic):
        """Start now; `clock` returns seconds."""
        self._clock, self._start = clock, clock()
        self._reports = [(0.0, 0.0)]  # ([s] since the start, amount that was done)

    def done(self, amount: float) -> None:
        """Note that `amount` of the work is done by now."""
        if amount > self._reports[-1][1]:
            self._reports.append((self._clock() - self._start, amount))

    def seconds(self, total: float) -> float | None:
        """Return the remaining time [s] up to `total`; None before the second report and at the end."""
        elapsed, done = self._reports[-1]
        if len(self._reports) < 3 or done >= total:
            return None
        later = (elapsed - self._at(0.5 * done)) / (0.5 * done)  # [s] for one part
        return max(0.0, later * (total - done) - (self._clock() - self._start - elapsed))

    def text(self, total: float) -> str:
        """Return the remaining time as text, "" if it is unknown."""
        seconds = self.seconds(total)
        if seconds is None:
            return ""
        return f"about {seconds:.0f} s left" if seconds < 90.0 else f"about {seconds / 60.0:.0f} min left"

    def _at(self, amount: float) -> float:
        """Return the time [s] at which `amount` was done, between two reports in proportion."""
        after = next(i for i, (_, done) in enumerate(self._reports) if done >= amount)
        (t0, a0), (t1, a1) = self._reports[after - 1], self._reports[after]
        return t0 + (t1 - t0) * (amount - a0) / (a1 - a0)
