"""`lapwing protocol`: bus protocol of a scene, for external services."""

from pathlib import Path
from typing import Annotated, Any

import typer

from lapwing.cli.app import app
from lapwing.cli.options import Overrides, SceneFile
from lapwing.cli.output_paths import check_distinct, claim, claim_plot
from lapwing.cli.preflight import with_solver_selected
from lapwing.cosim.complete_file import write_text


@app.command()
def protocol(
    scene: SceneFile,
    set_: Overrides = None,
    json: Annotated[
        Path | None, typer.Option(metavar="FILE", help="write the protocol and the run configuration as JSON")
    ] = None,
    plot: Annotated[
        Path | None, typer.Option(metavar="FILE", help="write a diagram of the services (PNG, SVG or PDF)")
    ] = None,
) -> None:
    """Show the ports, periods and columns of each service.

    docs/reference/protocol.md describes the protocol for external services.
    """
    import json as json_module

    from lapwing.cosim.transport.packet_layout import layout
    from lapwing.services.scene_resolver import resolve

    check_distinct({"SCENE": scene, "--json": json, "--plot": plot})
    claim(json)
    claim_plot(plot)
    config = resolve(with_solver_selected(scene, set_ or []))
    result = layout(config)
    if plot:
        from lapwing.views.service_diagram import draw

        draw(config, plot)
    if json:
        write_text(json, json_module.dumps(result, indent=1) + "\n")
    if json or plot:
        return
    typer.echo(f"{result['rate']} Hz, {result['interval_ns']} ns per tick, last tick {result['last_tick']}")
    for name in result["order"]:
        _show(name, result["services"][name])


def _show(name: str, service: dict[str, Any]) -> None:
    typer.echo(f"\n{name}")
    for port in service["inputs"]:
        typer.echo(f"  input {port['port']}" + (f", delayed by {port['delay']} ticks" if port["delay"] else ""))
    for port in service["ports"]:
        every = "every tick" if port["period"] == 1 else f"every {port['period']} ticks"
        typer.echo(f"  output {port['name']}, {every}: {len(port['columns'])} columns")
        for offset, column in enumerate(port["columns"]):
            typer.echo(f"    {8 * offset:5d}  {column}")
