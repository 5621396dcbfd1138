"""Compilation of kernels ahead of the first run."""

import time
from collections.abc import Mapping
from contextlib import nullcontext

from rich.console import Console
from rich.progress import BarColumn, Progress, Task, TextColumn
from rich.progress_bar import ProgressBar

from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.diagram.block_diagram import BlockDiagram
from lapwing.cosim.executors.single_process import PAGE
from lapwing.runs.compile_notice import Compilation, estimate, notify_on_compile
from lapwing.services.process_table import create_all, foreign_firmware
from lapwing.studies import metrics

NEARLY = 0.97  # share of a scene's estimate at which the bar waits


class _Bar(BarColumn):
    """Bar that advances within a scene by the estimate."""

    def render(self, task: Task) -> ProgressBar:
        now = min(time.monotonic() - task.fields["start_time"], NEARLY * task.fields["estimate"])
        return ProgressBar(total=task.total, completed=task.completed + now, width=self.bar_width)


def compile_ahead(setups: Mapping[str, RunConfig], console: Console) -> None:
    """Compile the kernels of scenes one after another, and print the time of each.

    Args:
        setups: run configurations by the name to print.
        console: shows a bar in a terminal, otherwise a line before each scene.
    """
    estimates = [estimate(setup).seconds for setup in setups.values()]
    total, done = sum(estimates), 0.0
    columns = (_Bar(bar_width=24), TextColumn("of about {task.total:.0f} s  {task.description}", markup=False))
    bar = Progress(*columns, console=console, transient=True) if console.is_terminal else None
    with bar or nullcontext():
        task = bar.add_task("", total=total, start_time=time.monotonic(), estimate=0.0) if bar else None
        for (name, setup), seconds in zip(setups.items(), estimates, strict=True):
            if bar and task is not None:
                bar.update(task, completed=done, description=name, start_time=time.monotonic(), estimate=seconds)

            def say(compilation: Compilation) -> None:
                if not bar:
                    console.print(compilation.notice, soft_wrap=True)

            started = time.perf_counter()
            with notify_on_compile(setup, say):
                ticks = 0 if foreign_firmware(setup) else 1  # the first tick of a firmware would start its program
                BlockDiagram(setup, create_all(setup), PAGE).advance(ticks)  # also compiles the loop over the blocks
                metrics.compile_ahead()
            done += seconds
            console.print(f"{name}: ready after {time.perf_counter() - started:.1f} s", soft_wrap=True)
