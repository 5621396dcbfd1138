"""How far a study of many flights is, and how long it still takes."""

import time

from rich.console import Console
from rich.progress import BarColumn, Progress, ProgressColumn, Task, TextColumn
from rich.text import Text


class _Left(ProgressColumn):
    """Time left, by the mean of the flights so far; rich's own forgets what took longer than 30 s."""

    def render(self, task: Task) -> Text:
        return Text(left(task.elapsed or 0.0, task.completed, task.total or 0.0))


def left(elapsed: float, done: float, total: float) -> str:
    """Time left in words, after `elapsed` seconds with so many of the flights done; "" while nothing is known."""
    if not 0.0 < done < total:
        return ""
    seconds = elapsed / done * (total - done)
    return f"about {seconds:.0f} s left" if seconds < 90.0 else f"about {seconds / 60.0:.0f} min left"


class Countdown:
    """A bar in a terminal, lines elsewhere; a context manager."""

    def __init__(self, console: Console, every: float = 0.0):
        """Between two lines are `every` seconds at least."""
        self._console, self._started, self._every, self._said = console, time.monotonic(), every, -every
        columns = (BarColumn(bar_width=24), TextColumn("{task.completed} of {task.total} flights"), _Left())
        said = TextColumn("{task.description}", markup=False)
        self._bar = Progress(*columns, said, console=console, transient=True) if console.is_terminal else None
        self._task = self._bar.add_task("", total=1) if self._bar else None

    def __enter__(self) -> "Countdown":
        if self._bar:
            self._bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        if self._bar:
            self._bar.stop()

    def say(self, text: str, done: int, total: int) -> None:
        """Show what is being done, and that `done` of `total` flights are."""
        if self._bar and self._task is not None:
            self._bar.update(self._task, description=text, completed=done, total=total)
            return
        if (now := time.monotonic()) - self._said < self._every and done < total:
            return
        self._said = now
        told = left(now - self._started, done, total)
        self._console.print(f"{done} of {total} flights{f', {told}' if told else ''}: {text}", soft_wrap=True)
