"""Compilation of kernels ahead of the first run."""

import time
from collections.abc import Mapping

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.diagram.block_diagram import BlockDiagram
from lapwing.cosim.executors.single_process import KEPT_TICKS
from lapwing.flights import metrics
from lapwing.runs.observer import Compilation, notify_on_compile
from lapwing.services.process_table import create_all, foreign_firmware


def compile_ahead(configs: Mapping[str, RunConfig], console: Console) -> None:
    """Compile the kernels of scenes one after another, and print the time of each.

    Args:
        configs: run configurations by the name to print.
        console: shows a bar in a terminal, otherwise a line before each scene.
    """
    text = TextColumn("{task.completed} of {task.total} scenes  {task.description}", markup=False)
    columns = (BarColumn(bar_width=24), TimeElapsedColumn(), text)

    def say(compilation: Compilation) -> None:
        if not console.is_terminal:
            console.print(compilation.notice, soft_wrap=True)

    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task("", total=len(configs))
        for name, config in configs.items():
            bar.update(task, description=name)
            started = time.perf_counter()
            with notify_on_compile(config, say):
                ticks = 0 if foreign_firmware(config) else 1  # the first tick of a firmware would start its program
                BlockDiagram(config, create_all(config), KEPT_TICKS).advance(
                    ticks
                )  # also compiles the loop over the blocks
                metrics.compile_ahead()
            console.print(f"{name}: ready after {time.perf_counter() - started:.1f} s", soft_wrap=True)
            bar.advance(task)
