"""The studies: performance, effects, accuracy."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from services.commands.app import app
from services.commands.errors import user_errors
from services.commands.files import check_distinct, check_plot, check_writable
from services.commands.options import (
    Overrides,
    SceneFile,
)

if TYPE_CHECKING:
    pass


@app.command()
def performance(
    subject: Annotated[Path, typer.Argument(metavar="SCENE|VEHICLE", help="a scene, or an airframe's TOML file")],
    json: Annotated[Path | None, typer.Option(metavar="FILE", help="write the figures as JSON")] = None,
) -> None:
    """Hover time, payload, range, ceiling, tilt and speed from the models, beside published figures."""
    from studies.performance import card, show, write_json

    with user_errors():
        check_writable(json)
        figures = card(subject)
        show(figures)
        if json:
            write_json(json, figures)


@app.command()
def effects(
    scene: SceneFile,
    set_: Overrides = None,
    within: Annotated[float, typer.Option(metavar="M", help="how far the trajectory may change")] = 0.01,
    json: Annotated[Path | None, typer.Option(metavar="FILE", help="write the study as JSON")] = None,
    plot: Annotated[Path | None, typer.Option(metavar="FILE", help="draw it (PNG, SVG or PDF)")] = None,
) -> None:
    """What each effect of a scene costs and changes, and which of them it could do without."""
    from rich.console import Console

    from services.scene import load
    from studies.effects import show
    from studies.effects.study import study

    with user_errors():
        if not within > 0.0:
            raise ValueError(f"--within {within:g}: expected a distance above 0 m")
        check_distinct({"SCENE": scene, "--json": json, "--plot": plot})
        check_writable(json)
        check_plot(plot)
        console = Console()
        found = study(load(scene, set_ or []), within, lambda text: console.print(text, highlight=False))
        show.show(console, found)
        if json:
            show.write_json(json, found)
        if plot:
            show.plot(plot, found)


@app.command()
def accuracy(
    target: Annotated[str, typer.Argument(metavar="TARGET", help="a system of the study, or a scene (TOML)")],
    set_: Overrides = None,
    goal: Annotated[
        float | None, typer.Option("--target", metavar="ERROR", help="name the cheapest choice that meets it: 1e-6")
    ] = None,
    json: Annotated[Path | None, typer.Option(metavar="FILE", help="write all points as JSON")] = None,
    plot: Annotated[Path | None, typer.Option(metavar="FILE", help="draw error over time (PNG, SVG or PDF)")] = None,
) -> None:
    """Error against wall time of every integrator, on a system whose answer is known, or on a scene's plant."""
    with user_errors():
        from studies.accuracy import command

        check_writable(json)
        check_plot(plot)
        command.run(target, set_ or [], goal, json, plot)
