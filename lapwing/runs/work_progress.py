"""Remaining time of long work, and its bar in a terminal or a notebook if it was started from Python."""

import html
import sys
import threading
import time
from collections.abc import Callable
from typing import Any, Protocol

from lapwing.runs.compile_notice import Compilation

DELAY = 2.0  # [s] of work before a bar appears
PERIOD = 0.25  # [s] between two updates of the bar
NEARLY = 0.97  # share of an estimate that was too short at which the bar waits


class TimeLeft:
    """Estimate of the remaining time of work in many equal parts, from the time that its later half took.

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


class Picture(Protocol):
    """Output on which a bar is drawn."""

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
    """Bar of one piece of work; a context manager. It appears after DELAY seconds and disappears at the end."""

    def __init__(self, title: str, total: float, unit: str):
        """Create the bar of work that ends at `total`, in `unit`."""
        self._title, self._total, self._unit = title, total, unit
        self._compiles: Compilation | None = None
        self._start, self._done, self._left = time.monotonic(), 0.0, TimeLeft()
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

    def compiling(self, compilation: Compilation) -> None:
        """Note that kernels compile, until the first call of `show`."""
        self._start, self._compiles = time.monotonic(), compilation

    def show(self, done: float) -> None:
        """Note that `done` of the total is reached."""
        if self._compiles is not None:
            self._compiles, self._left = None, TimeLeft()
        self._done = done
        self._left.done(done)

    def state(self) -> tuple[float, str]:
        """Return the share of the bar that is full, and its line."""
        if (compilation := self._compiles) is not None:
            elapsed = time.monotonic() - self._start
            share = min(NEARLY, elapsed / max(compilation.seconds, 1e-9))
            return share, f"{self._title}: compiling once, {elapsed:.0f} of about {compilation.seconds:.0f} s"
        left = self._left.text(self._total)
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
