"""`lapwing service`, `protocol` and `certificates`: services that are started separately."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import typer

from lapwing.cli import run_options
from lapwing.cli.app import app
from lapwing.cli.options import (
    KeyPrefix,
    Keys,
    LinkOptions,
    Overrides,
    PlanFiles,
    SceneFile,
    Speed,
    absolute,
    check_pace,
    parse_speed,
    with_options,
)
from lapwing.cli.output_paths import check_distinct, check_not_dash, claim, claim_plot
from lapwing.cli.preflight import with_solver_selected
from lapwing.cli.run_options import check_endpoints
from lapwing.cosim.complete_file import write_text


@dataclass(frozen=True, kw_only=True)
class ServiceOptions(LinkOptions):
    """Options of `lapwing service`."""

    name: Annotated[str, typer.Argument(metavar="NAME", help="plant, sensors, autopilot, ...")]
    scene: SceneFile
    set_: Overrides = None
    plan: PlanFiles = None
    endpoints: Annotated[str, typer.Option(metavar="TABLE", help="name=endpoint,... of all participants")]
    key_prefix: KeyPrefix = "lapwing"
    speed: Speed = None
    log: Annotated[Path | None, typer.Option(metavar="FILE", help="MCAP log of the recorder")] = None
    listen: Annotated[
        list[str] | None,
        typer.Option(metavar="ENDPOINT", help="endpoint at which the router accepts clients (repeatable)"),
    ] = None
    keys: Keys = None


@app.command()
@with_options
def service(options: ServiceOptions) -> None:
    """Run one service of a scene, for runs on several hosts.

    Exit codes: 1 the run failed, 2 invalid input.
    """
    from lapwing.cosim.transport.bus_keys import check_key_prefix
    from lapwing.runs.distributed_run import external_services, parse_endpoints
    from lapwing.services import process_table
    from lapwing.services.process_main import ProcessSpec, run_participant
    from lapwing.services.scene_resolver import resolve

    name, scene, overrides, plan = options.name, options.scene, options.set_ or [], options.plan or []
    check_key_prefix(options.key_prefix)
    table = parse_endpoints(options.endpoints)
    entry = process_table.entry(process_table.service_of_encoder(name) or name)
    if name not in table:
        raise ValueError(f"--endpoints: no endpoint for {name} itself")
    check_endpoints("--endpoints", table.values(), options.keys, options.insecure)
    check_endpoints("--listen", options.listen or [], options.keys, options.insecure)
    required = {
        process_table.RECORDER: ("--log FILE", options.log),
        process_table.FOXGLOVE: ("--foxglove HOST:PORT", options.foxglove),
        process_table.ROS2: ("--ros2 DOMAIN", options.ros2),
    }
    if name in required and required[name][1] is None:
        raise ValueError(f"service {name}: expected {required[name][0]}")
    speed = parse_speed(options.speed)
    options.validate_links()
    loaded = with_solver_selected(scene, [*overrides, *run_options.plan_overrides(plan, scene, overrides)])
    config = resolve(loaded, run_options.plan_commands(plan, loaded))
    check_pace(f"--speed {options.speed}", speed, config.interval)
    if entry.lock_step and entry.name not in config.services:
        typer.echo(f"{name}: not part of {scene}")  # compose starts every service
        return
    run_participant(
        ProcessSpec(
            name=name,
            config=config,
            peers=table,
            key_prefix=options.key_prefix,
            speed=speed,
            log=str(options.log or ""),
            sources={source: content.decode() for source, content in loaded.sources.items()},
            open=tuple(options.listen or ()),
            external=external_services(table),
            keys=absolute(options.keys),
            **options.spec,
        )
    )


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

    from lapwing.cosim.transport.packets import layout
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
    from lapwing.views.terminal import counted

    typer.echo(f"\n{name}")
    for port in service["inputs"]:
        delay = f", delayed by {counted(port['delay'], 'tick')}" if port["delay"] else ""
        typer.echo(f"  input {port['port']}{delay}")
    for port in service["ports"]:
        every = "every tick" if port["period"] == 1 else f"every {port['period']} ticks"
        typer.echo(f"  output {port['name']}, {every}: {len(port['columns'])} columns")
        for offset, column in enumerate(port["columns"]):
            typer.echo(f"    {8 * offset:5d}  {column}")


@app.command()
def certificates(
    folder: Annotated[Path, typer.Argument(metavar="FOLDER", help="folder to create")],
    days: Annotated[int, typer.Option(metavar="N", min=1, max=3650, help="validity [days]")] = 365,
) -> None:
    """Create TLS certificates for runs on several hosts.

    Writes a certificate for each service and a read-only one for viewers to FOLDER.
    """
    from lapwing.cosim.access.certificates import make
    from lapwing.cosim.access.zenoh_access import VIEWER
    from lapwing.services.security import names

    check_not_dash(folder)
    holders = [*names(), VIEWER]
    make(folder, holders, days)
    typer.echo(f"{folder}: certificates of {', '.join(holders)}; copy to each host only its own; do not commit them")
