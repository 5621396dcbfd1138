"""How far a run is: a progress bar in a terminal, a line now and then elsewhere."""

import time

from rich.console import Console
from rich.progress import BarColumn, Progress, ProgressColumn, Task, TextColumn
from rich.text import Text

from messages import PoseStamped, Status

LINE_PERIOD = 2.0  # [s] of wall time between two lines where the output is no terminal


class _Factor(ProgressColumn):
    def render(self, task: Task) -> Text:
        return Text(f"{task.completed / task.elapsed:5.1f}x" if task.elapsed else "    -x")


class Display:
    """Shows simulation time, real-time factor, position and phase."""

    def __init__(self, console: Console, duration: float):
        """`duration` [s] is where the bar ends."""
        self._console = console
        self._duration = duration
        self._started = time.monotonic()
        self._next_line = self._started + LINE_PERIOD
        self._bar: Progress | None = None
        if console.is_terminal:
            self._bar = Progress(
                BarColumn(bar_width=24),
                TextColumn("{task.completed:6.1f} / {task.total:.0f} s"),
                _Factor(),
                TextColumn("{task.description}", markup=False),
                console=console,
                transient=True,
            )
            self._task = self._bar.add_task("starting", total=duration)

    def __enter__(self) -> "Display":
        if self._bar:
            self._bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        if self._bar:
            self._bar.stop()

    def begin(self) -> None:
        """The first message has come: from now on time counts."""
        self._started = time.monotonic()
        self._next_line = self._started + LINE_PERIOD
        if self._bar:
            self._bar.reset(self._task, total=self._duration, description="")

    def say(self, line: str) -> None:
        """Print a line."""
        self._console.print(line, highlight=False, soft_wrap=True)

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
            self._console.print(f"t = {seconds:6.1f} s  {factor:5.1f}x  {line}", highlight=False)
