"""Progress and remaining time of a study with many flights."""

import time

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn

from lapwing.runs.time_left import TimeLeft


class Countdown:
    """A bar in a terminal, lines elsewhere; a context manager."""

    def __init__(self, console: Console, every: float = 0.0):
        """Create the display; outside a terminal it prints at most one line per `every` [s]."""
        self._console, self._left, self._every, self._printed = console, TimeLeft(), every, -every
        columns = (BarColumn(bar_width=24), TextColumn("{task.completed} of {task.total} flights  {task.fields[left]}"))
        description_column = TextColumn("{task.description}", markup=False)
        self._bar = (
            Progress(*columns, description_column, console=console, transient=True) if console.is_terminal else None
        )
        self._task = self._bar.add_task("", total=1, left="") if self._bar else None

    def __enter__(self) -> "Countdown":
        if self._bar:
            self._bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        if self._bar:
            self._bar.stop()

    def say(self, text: str, done: int, total: int) -> None:
        """Show that `done` of `total` flights are finished, and the current work."""
        self._left.done(done)
        remaining = self._left.text(total)
        if self._bar and self._task is not None:
            self._bar.update(self._task, description=text, completed=done, total=total, left=remaining)
            return
        if (now := time.monotonic()) - self._printed < self._every and done < total:
            return
        self._printed = now
        self._console.print(f"{done} of {total} flights{f', {remaining}' if remaining else ''}: {text}", soft_wrap=True)
