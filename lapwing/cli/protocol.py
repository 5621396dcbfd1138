"""`lapwing protocol`: what a program of one's own has to know of a scene to take part in it."""

from pathlib import Path
from typing import Annotated, Any

import typer

from lapwing.cli.app import app
from lapwing.cli.error_exit import user_errors
from lapwing.cli.options import Overrides, SceneFile
from lapwing.cli.output_paths import claim
from lapwing.cli.preflight import decided


@app.command()
def protocol(
    scene: SceneFile,
    set_: Overrides = None,
    json: Annotated[Path | None, typer.Option(metavar="FILE", help="write it as JSON, with the whole set-up")] = None,
    plot: Annotated[Path | None, typer.Option(metavar="FILE", help="draw the services and what they hand on")] = None,
) -> None:
    """What each service of a scene takes and gives: ports, periods, columns (docs/reference/protocol.md)."""
    import json as json_module

    from lapwing.cosim.transport.packet_layout import layout
    from lapwing.services.scene_resolver import resolve

    with user_errors():
        claim(json)
        claim(plot)
        setup = resolve(decided(scene, set_ or []))
        found = layout(setup)
        if plot:
            from lapwing.studies.service_diagram import draw

            draw(setup, plot)
        if json:
            json.write_text(json_module.dumps(found, indent=1) + "\n")
        if json or plot:
            return
        typer.echo(f"{found['rate']} Hz, {found['interval_ns']} ns a tick, last tick {found['last_tick']}")
        for name in found["order"]:
            _show(name, found["services"][name])


def _show(name: str, service: dict[str, Any]) -> None:
    typer.echo(f"\n{name}")
    for taken in service["inputs"]:
        typer.echo(f"  takes {taken['port']}" + (f" of {taken['delay']} ticks ago" if taken["delay"] else ""))
    for port in service["ports"]:
        every = "every tick" if port["period"] == 1 else f"every {port['period']} ticks"
        typer.echo(f"  gives {port['name']} {every}: {len(port['columns'])} columns")
        for offset, column in enumerate(port["columns"]):
            typer.echo(f"    {8 * offset:5d}  {column}")
