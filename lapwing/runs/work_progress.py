"""Remaining time of long work, and a progress bar in a terminal or notebook for work started from Python."""

import html
import sys
import threading
import time
from collections.abc import Callable
from typing import Any, Protocol

from lapwing.runs.observer import Compilation

DELAY = 2.0  # [s] of work before a bar appears
PERIOD = 0.25  # [s] between two updates of the bar
MEASURED = 1.0  # [s] of measured work before a remaining time is shown
BASIS, LONG = 0.05, 10.0  # also required: measured share of the work, or measured time [s]


class TimeLeft:
    """Estimate of the remaining time of work in equal parts, from the duration of its later half in this call.

    The first part of each worker takes longer (compilation, start of the worker) and never counts. Parts that run at
    the same time end together, so only spans of a multiple of `parallel` reports have a known duration.
    """

    def __init__(self, parallel: int = 1, clock: Callable[[], float] = time.monotonic):
        """Start the measurement.

        Args:
            parallel: number of parts that run at the same time; 0: unknown, without an estimate.
            clock: returns seconds.
        """
        self._parallel, self._clock, self._start = parallel, clock, clock()
        self._reports: list[tuple[float, float]] = []  # ([s] since the start, completed amount)

    def done(self, amount: float) -> None:
        """Record that `amount` of the work is done; call it once for each part."""
        if amount > (self._reports[-1][1] if self._reports else 0.0):
            self._reports.append((self._clock() - self._start, amount))

    def seconds(self, total: float) -> float | None:
        """Return the remaining time [s] up to `total`; None until enough is measured, and at the end."""
        reports, step = self._reports, self._parallel
        if step < 1 or len(reports) < 2 * step or reports[-1][1] >= total:
            return None
        elapsed, done = reports[-1]
        first = len(reports) - 1 - step
        while first >= 2 * step - 1 and done - reports[first][1] < 0.5 * done:
            first -= step
        span, amount = elapsed - reports[first][0], done - reports[first][1]
        if span < MEASURED or (amount < BASIS * total and span < LONG):
            return None
        return max(0.0, span / amount * (total - done) - (self._clock() - self._start - elapsed))

    def text(self, total: float, most: bool = False) -> str:
        """Return the remaining time as text, "" if it is unknown; `most`: the work may end before `total`."""
        seconds = self.seconds(total)
        if seconds is None:
            return ""
        number = f"{seconds:.0f} s" if seconds < 90.0 else f"{seconds / 60.0:.0f} min"
        return f"{'at most ' if most else ''}about {number} left"


class Picture(Protocol):
    """Interface of an output for a bar."""

    def draw(self, share: float, text: str) -> None:
        """Show a bar, `share` of it full (0 to 1), and a line."""
        ...

    def clear(self) -> None:
        """Remove the bar."""
        ...


class TerminalPicture:
    """Bar on the standard error output, removed at its end."""

    def __init__(self) -> None:
        from rich.console import Console
        from rich.progress import BarColumn, Progress, TextColumn

        columns = (BarColumn(bar_width=24), TextColumn("{task.description}", markup=False))
        self._bar = Progress(*columns, console=Console(stderr=True), transient=True, auto_refresh=False)
        self._task = self._bar.add_task("", total=1.0)
        self._bar.start()

    def draw(self, share: float, text: str) -> None:
        """Show a bar, `share` of it full (0 to 1), and a line."""
        self._bar.update(self._task, completed=share, description=text, refresh=True)

    def clear(self) -> None:
        """Remove the bar."""
        self._bar.stop()


class NotebookPicture:
    """Bar in the output of a notebook's cell, emptied at its end."""

    def __init__(self) -> None:
        from IPython.display import HTML, display

        self._page = HTML
        self._output: Any = display(HTML(""), display_id=True)

    def draw(self, share: float, text: str) -> None:
        """Show a bar, `share` of it full (0 to 1), and a line."""
        bar = f'<progress value="{share:.3f}" max="1"></progress> <code>{html.escape(text)}</code>'
        self._output.update(self._page(bar))

    def clear(self) -> None:
        """Remove the bar."""
        self._output.update(self._page(""))


def picture() -> type[Picture] | None:
    """Return the output for this program; None without a terminal or notebook."""
    shell = sys.modules.get("IPython")
    if shell is not None and hasattr(shell.get_ipython(), "kernel"):
        return NotebookPicture
    return TerminalPicture if sys.stderr is not None and sys.stderr.isatty() else None


class WorkProgress:
    """Progress bar of some work; a context manager. It appears after DELAY seconds and disappears at the end."""

    def __init__(self, title: str, total: float, unit: str, parallel: int = 1):
        """Create the bar of work that ends at `total`, a flight in "s" perhaps before it; see `TimeLeft.__init__`."""
        self._title, self._total, self._unit, self._parallel = title, total, unit, parallel
        self._compiles = False
        self._start, self._done, self._left = time.monotonic(), 0.0, TimeLeft(parallel)
        self._end, self._thread = threading.Event(), None
        if (kind := picture()) is not None:
            self._thread = threading.Thread(target=self._run, args=(kind,), daemon=True)

    def __enter__(self) -> "WorkProgress":
        if self._thread:
            self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        if self._thread:
            self._end.set()
            self._thread.join()

    def compiling(self, _: Compilation) -> None:
        """Show that kernels compile, until the first call of `show`."""
        self._start, self._compiles = time.monotonic(), True

    def show(self, done: float) -> None:
        """Show that `done` of the total is reached."""
        if self._compiles:
            self._compiles, self._left = False, TimeLeft(self._parallel)
        self._done = done
        self._left.done(done)

    def state(self) -> tuple[float, str]:
        """Return the share of the bar that is full, and its line."""
        if self._compiles:
            return 0.0, f"{self._title}: compiling once, {time.monotonic() - self._start:.0f} s"
        left = self._left.text(self._total, most=self._unit == "s")
        line = f"{self._title}: {self._done:.{0 if self._unit == 'flights' else 1}f} of {self._total:.4g} {self._unit}"
        return self._done / self._total, f"{line}, {left}" if left else line

    def _run(self, kind: type[Picture]) -> None:
        if self._end.wait(DELAY):
            return
        output = kind()
        try:
            while True:
                output.draw(*self.state())
                if self._end.wait(PERIOD):
                    return
        finally:
            output.clear()
