"""Kernels compiled ahead of the first run."""

import time
from collections.abc import Mapping
from contextlib import nullcontext

from rich.console import Console
from rich.progress import BarColumn, Progress, Task, TextColumn
from rich.progress_bar import ProgressBar

from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.diagram.block_diagram import BlockDiagram
from lapwing.cosim.executors.single_process import PAGE
from lapwing.runs.compile_notice import Compilation, guessed, notify_on_compile
from lapwing.services.process_table import create_all, foreign_firmware
from lapwing.studies import metrics

NEARLY = 0.97  # of a scene's guess, where the bar waits


class _Bar(BarColumn):
    """Goes on within a scene by its guess."""

    def render(self, task: Task) -> ProgressBar:
        now = min(time.monotonic() - task.fields["began"], NEARLY * task.fields["guess"])
        return ProgressBar(total=task.total, completed=task.completed + now, width=self.bar_width)


def compile_ahead(setups: Mapping[str, RunConfig], console: Console) -> None:
    """Compile what scenes need, one after the other; says of each how long it took, and in a bar how far it is.

    Args:
        setups: by the name to print.
        console: a terminal has a bar, anything else a line before a scene is compiled.
    """
    guesses = [guessed(setup).seconds for setup in setups.values()]
    total, done = sum(guesses), 0.0
    columns = (_Bar(bar_width=24), TextColumn("of about {task.total:.0f} s  {task.description}", markup=False))
    bar = Progress(*columns, console=console, transient=True) if console.is_terminal else None
    with bar or nullcontext():
        task = bar.add_task("", total=total, began=time.monotonic(), guess=0.0) if bar else None
        for (name, setup), guess in zip(setups.items(), guesses, strict=True):
            if bar and task is not None:
                bar.update(task, completed=done, description=name, began=time.monotonic(), guess=guess)

            def say(what: Compilation) -> None:
                if not bar:
                    console.print(what.notice, soft_wrap=True)

            started = time.perf_counter()
            with notify_on_compile(setup, say):
                ticks = 0 if foreign_firmware(setup) else 1  # the first tick of a firmware would start it
                BlockDiagram(setup, create_all(setup), PAGE).advance(ticks)  # what steps the parts is compiled, too
                metrics.compile_ahead()
            done += guess
            console.print(f"{name}: ready after {time.perf_counter() - started:.1f} s", soft_wrap=True)
