"""`lapwing service`: one service of a scene, as `run` starts them all."""

from pathlib import Path
from typing import Annotated

import typer

from lapwing.cli.app import app
from lapwing.cli.choice import decided
from lapwing.cli.errors import user_errors
from lapwing.cli.links import check_links
from lapwing.cli.options import (
    Insecure,
    KeyPrefix,
    MavlinkKey,
    MavlinkUrls,
    Overrides,
    PlanFile,
    SceneFile,
    Speed,
    parse_speed,
)


@app.command()
def service(
    name: Annotated[str, typer.Argument(metavar="NAME", help="plant, sensors, autopilot, ...")],
    scene: SceneFile,
    peers: Annotated[str, typer.Option(metavar="TABLE", help="name=endpoint,... of all participants")],
    set_: Overrides = None,
    key_prefix: KeyPrefix = "lapwing",
    speed: Speed = None,
    log: Annotated[Path | None, typer.Option(metavar="FILE", help="the recorder's MCAP log")] = None,
    open_: Annotated[
        list[str] | None, typer.Option("--open", metavar="ENDPOINT", help="where the router listens for clients")
    ] = None,
    mavlink: MavlinkUrls = None,
    mavlink_key: MavlinkKey = None,
    insecure: Insecure = False,
    plan: PlanFile = None,
) -> None:
    """Run one service of a scene (`run` starts them all)."""
    from cosim.key_prefix import check_key_prefix
    from lapwing.runs.joined import parse_peers
    from services import processes
    from services.common.plan import OPERATED
    from services.common.plan import read as read_plan
    from services.common.vehicle import start_height
    from services.participant import Participation, take_part
    from services.table import resolve

    with user_errors():
        check_key_prefix(key_prefix)
        table = parse_peers(peers)
        entry = processes.entry(name)
        if name not in table:
            raise ValueError(f"--peers: no endpoint for {name} itself")
        if name == processes.RECORDER and log is None:
            raise ValueError("--log: the recorder needs the name of its log")
        if name == processes.MAVLINK:
            check_links(mavlink, mavlink_key, insecure)
        loaded = decided(scene, [*(set_ or []), *(OPERATED if plan else [])])
        commands = tuple(read_plan(plan, start_height(loaded))) if plan else ()
        setup = resolve(loaded, commands)
        if entry.lock_step and name not in setup.services:
            typer.echo(f"{name}: {scene} does not call for it")  # compose starts every service there is
            return
        take_part(
            Participation(
                name=name,
                setup=setup,
                peers=table,
                key_prefix=key_prefix,
                speed=parse_speed(speed),
                log=str(log or ""),
                sources={source: content.decode() for source, content in loaded.sources.items()},
                open=tuple(open_ or ()),
                mavlink=tuple(mavlink or ()),
                mavlink_key=str(mavlink_key or ""),
                insecure=insecure,
            )
        )
