"""Compilation of kernels ahead of the first run."""

import time
from collections.abc import Mapping

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.diagram.block_diagram import BlockDiagram
from lapwing.cosim.executors.single_process import PAGE
from lapwing.runs.compile_notice import Compilation, notify_on_compile
from lapwing.services.process_table import create_all, foreign_firmware
from lapwing.studies import metrics


def compile_ahead(setups: Mapping[str, RunConfig], console: Console) -> None:
    """Compile the kernels of scenes one after another, and print the time of each.

    Args:
        setups: run configurations by the name to print.
        console: shows a bar in a terminal, otherwise a line before each scene.
    """
    text = TextColumn("{task.completed} of {task.total} scenes  {task.description}", markup=False)
    columns = (BarColumn(bar_width=24), TimeElapsedColumn(), text)

    def say(compilation: Compilation) -> None:
        if not console.is_terminal:
            console.print(compilation.notice, soft_wrap=True)

    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task("", total=len(setups))
        for name, setup in setups.items():
            bar.update(task, description=name)
            started = time.perf_counter()
            with notify_on_compile(setup, say):
                ticks = 0 if foreign_firmware(setup) else 1  # the first tick of a firmware would start its program
                BlockDiagram(setup, create_all(setup), PAGE).advance(ticks)  # also compiles the loop over the blocks
                metrics.compile_ahead()
            console.print(f"{name}: ready after {time.perf_counter() - started:.1f} s", soft_wrap=True)
            bar.advance(task)
