"""Compilation of kernels ahead of the first run."""

import sys
import time
from collections.abc import Mapping

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.diagram.block_diagram import BlockDiagram
from lapwing.cosim.executors.single_process import KEPT_TICKS
from lapwing.flights import metrics
from lapwing.services.process_table import CLOCK_OWNER, create, create_all, foreign_firmware
from lapwing.studies.workers import Workers


def compile_service(config: RunConfig, name: str) -> str:
    """Compile the blocks of a service. Return its name and that of the scene."""
    BlockDiagram(config, [create(config, name)], KEPT_TICKS)
    return f"{config.scene} {name}"


def compile_ahead(configs: Mapping[str, RunConfig], console: Console, workers: Workers) -> None:
    """Compile the kernels of scenes, and print for each when it is ready.

    Args:
        configs: run configurations by the name to print.
        console: shows a bar if it is a terminal; otherwise a line on standard error begins the work.
        workers: compile services beside each other.
    """
    started = time.perf_counter()
    # the plant takes longest
    tasks = [(c, name) for c in configs.values() for name in sorted(c.order, key=lambda name: name != CLOCK_OWNER)]
    text = TextColumn("kernels of {task.completed} of {task.total} services  {task.description}", markup=False)
    columns = (BarColumn(bar_width=24), TimeElapsedColumn(), text)
    if tasks and not console.is_terminal:
        print(f"compiling or loading the kernels of {len(tasks)} services ...", file=sys.stderr, flush=True)
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task("", total=len(tasks))
        for _, compiled in workers(compile_service, tasks):
            bar.update(task, advance=1, description=compiled)
        metrics.compile_ahead()
        for name, config in configs.items():
            ticks = 0 if foreign_firmware(config) else 1  # the first tick of a firmware would start its program
            BlockDiagram(config, create_all(config), KEPT_TICKS).advance(ticks)  # compiles the loop over the blocks
            console.print(f"{name}: ready after {time.perf_counter() - started:.1f} s", soft_wrap=True)
