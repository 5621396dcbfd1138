"""What a run comes to: the figures that `lapwing run` prints and writes as JSON."""

import json
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from cosim.scene import Scene
from services.common.sections import Published

AXES = {"x": "m", "y": "m", "z": "m", "roll": "rad", "pitch": "rad", "yaw": "rad"}


def write_json(path: Path, result: dict[str, Any]) -> None:
    """Write `result` for other programs."""
    path.write_text(json.dumps(result, indent=2) + "\n", encoding="utf-8")


def show(console: Console, scene: Scene, result: dict[str, Any]) -> None:
    """Print `result` for people."""
    published = scene[Published]
    if result["rmse"]:
        console.print("Root-mean-square error against the reference")
        table = Table()
        table.add_column("axis")
        table.add_column("this run", justify="right")
        if published.rmse:
            table.add_column(published.source, justify="right")
        for axis, value in result["rmse"].items():
            row = [f"{axis} [{AXES[axis]}]", f"{value:.4f}"]
            if published.rmse:
                row.append(f"{published.rmse[axis]:.4f}" if axis in published.rmse else "")
            table.add_row(*row)
        console.print(table)
    console.print(
        f"{result['sim_time_s']:.1f} s simulated in {result['wall_time_s']:.1f} s: "
        f"real-time factor {result['real_time_factor']:.1f} ({result['mode']})",
        highlight=False,
    )
    console.print(f"digest  {result['digest']}", soft_wrap=True, highlight=False)
    console.print(f"log     {result['log']}", soft_wrap=True, highlight=False)
    if result["report"]:
        console.print(f"report  {result['report']}", soft_wrap=True, highlight=False)
