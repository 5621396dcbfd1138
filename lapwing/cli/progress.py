"""Progress of a run and of a study: a bar in a terminal, otherwise occasional lines."""

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Self

from rich.console import Console
from rich.progress import BarColumn, Progress, ProgressColumn, Task, TextColumn
from rich.text import Text

from lapwing.messages import PoseStamped, Status
from lapwing.runs.observer import Compilation
from lapwing.runs.work_progress import TimeLeft

LINE_PERIOD = 2.0  # [s] of wall time between two lines if the output is not a terminal


class _Factor(ProgressColumn):
    def render(self, task: Task) -> Text:
        if task.total is None:  # compiling
            return Text("")
        return Text(f"{task.completed / task.elapsed:5.1f}x" if task.elapsed else "    -x")


class _Done(ProgressColumn):
    """Show the progress: simulated seconds, or elapsed seconds while kernels compile."""

    def render(self, task: Task) -> Text:
        if task.total is None:
            return Text(f"{task.elapsed or 0.0:4.0f} s")
        return Text(f"{task.completed:6.1f} / {task.total:.0f} s")


class _TerminalBar:
    """Context manager that shows the bar if the output is a terminal."""

    _bar: Progress | None

    def __enter__(self) -> Self:
        if self._bar:
            self._bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        if self._bar:
            self._bar.stop()


class RunProgress(_TerminalBar):
    """Progress display with simulation time, real-time factor, position and phase."""

    def __init__(self, console: Console, duration: float):
        """Show a bar that ends at `duration` [s]."""
        self._console = console
        self._duration = duration
        self._started = time.monotonic()
        self._next_line = self._started + LINE_PERIOD
        self._bar = None
        if console.is_terminal:
            self._bar = Progress(
                BarColumn(bar_width=24),
                _Done(),
                _Factor(),
                TextColumn("{task.description}", markup=False),
                console=console,
                transient=True,
            )
            self._task = self._bar.add_task("starting", total=duration)

    def begin(self) -> None:
        """Start the bar of the flight, at the first message."""
        self._started = time.monotonic()
        self._next_line = self._started + LINE_PERIOD
        self._restart("", self._duration)

    def compiling(self, compilation: Compilation) -> None:
        """Show that kernels are being compiled."""
        if self._bar:
            self._restart(f"compiling {compilation.scene}, once", None)
        else:
            self.say(compilation.notice)

    def _restart(self, description: str, total: float | None) -> None:
        if self._bar:
            self._bar.remove_task(self._task)
            self._task = self._bar.add_task(description, total=total)

    def say(self, line: str) -> None:
        """Print a line."""
        self._console.print(line, soft_wrap=True)

    def show(self, time_ns: int, pose: bytes | None, status: bytes | None) -> None:
        """Show the state at `time_ns`, from the newest payloads of the pose and status topics."""
        text = []
        if pose is not None:
            p = PoseStamped.decode(pose).pose.position
            text.append(f"({p.x:6.2f}, {p.y:6.2f}, {p.z:6.2f}) m")
        if status is not None:
            text.append(Status.decode(status).phase)
        line = "  ".join(text)
        seconds = time_ns * 1e-9
        if self._bar:
            self._bar.update(self._task, completed=seconds, description=line)
        elif time.monotonic() >= self._next_line:
            self._next_line = time.monotonic() + LINE_PERIOD
            factor = seconds / max(1e-9, time.monotonic() - self._started)
            self.say(f"t = {seconds:6.1f} s  {factor:5.1f}x  {line}")


class StudyProgress(_TerminalBar):
    """Progress display with the number of finished flights of a study, and its remaining time."""

    def __init__(
        self, console: Console, unit: str, parallel: int = 0, every: float = 0.0, most: bool = False, before: int = 0
    ):
        """Create the display.

        Args:
            console: a terminal has a bar, other output lines.
            unit: name of the parts of the work.
            parallel: number of parts that run at the same time; 0: unknown or unequal parts, without a remaining time.
            every: [s] least time between two lines.
            most: the study may end before all parts are finished.
            before: number of parts that an earlier command has finished; the remaining time does not count them.
        """
        self._before = before
        self._console, self._left, self._unit, self._most = console, TimeLeft(parallel), unit, most
        self._every, self._printed = every, -every
        columns = (BarColumn(bar_width=24), TextColumn("{task.completed} of {task.total} {task.fields[rest]}"))
        description_column = TextColumn("{task.description}", markup=False)
        self._bar = (
            Progress(*columns, description_column, console=console, transient=True) if console.is_terminal else None
        )
        self._task = self._bar.add_task("", total=1, rest=unit) if self._bar else None

    def say(self, text: str, done: int, total: int) -> None:
        """Show that `done` of `total` parts are finished, and the current work."""
        self._left.done(done - self._before)
        remaining = self._left.text(total - self._before, self._most)
        if self._bar and self._task is not None:
            rest = f"{self._unit}  {remaining}"
            self._bar.update(self._task, description=text, completed=done, total=max(total, 1), rest=rest)
            return
        if (now := time.monotonic()) - self._printed < self._every and done < total:
            return
        self._printed = now
        parts = f"{done} of {total} {self._unit}{f', {remaining}' if remaining else ''}"
        self._console.print(f"{parts}: {text}", soft_wrap=True)


@contextmanager
def step_progress(
    console: Console, unit: str, parallel: int = 0, announced: bool = False
) -> Iterator[Callable[[str, int, int], None]]:
    """Yield `StudyProgress.say` of a bar; without a terminal it is silent.

    Args:
        console: where the bar is shown.
        unit: what is counted.
        parallel: number of units that proceed at once, 0 for unknown.
        announced: print the first text to standard error where there is no terminal: no error follows that a user can
            make, which would not be the only line.
    """
    if console.is_terminal:
        with StudyProgress(console, unit, parallel) as progress:
            yield progress.say
        return
    started = False

    def begin(text: str, _done: int, _total: int) -> None:
        nonlocal started
        if announced and text and not started:
            started = True
            print(f"{text} ...", file=sys.stderr, flush=True)

    yield begin
