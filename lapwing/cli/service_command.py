"""`lapwing service`: one service of a scene, as `run` starts them all."""

from pathlib import Path
from typing import Annotated

import typer

from lapwing.cli import plan_options
from lapwing.cli.app import app
from lapwing.cli.endpoint_checks import check_endpoints, check_links, check_ros2
from lapwing.cli.error_exit import user_errors
from lapwing.cli.options import (
    FoxgloveAddress,
    Insecure,
    KeyPrefix,
    Keys,
    MavlinkKey,
    MavlinkUrls,
    Overrides,
    PlanFiles,
    Ros2Domain,
    Ros2Router,
    SceneFile,
    Speed,
    parse_speed,
)
from lapwing.cli.preflight import decided


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
    foxglove: FoxgloveAddress = None,
    ros2: Ros2Domain = None,
    ros2_router: Ros2Router = None,
    keys: Keys = None,
    plan: PlanFiles = None,
) -> None:
    """Run one service of a scene (`run` starts them all)."""
    from lapwing.cosim.transport.key_prefix import check_key_prefix
    from lapwing.runs.distributed_run import elsewhere, parse_peers
    from lapwing.services import process_table
    from lapwing.services.foxglove.server import check_address
    from lapwing.services.process_main import ProcessSpec, take_part
    from lapwing.services.scene_resolver import resolve

    with user_errors():
        check_key_prefix(key_prefix)
        table = parse_peers(peers)
        entry = process_table.entry(process_table.encoded(name) or name)
        if name not in table:
            raise ValueError(f"--peers: no endpoint for {name} itself")
        check_endpoints("--peers", table.values(), keys, insecure)
        check_endpoints("--open", open_ or [], keys, insecure)
        if name == process_table.RECORDER and log is None:
            raise ValueError("--log: the recorder needs the name of its log")
        if name == process_table.FOXGLOVE:
            if foxglove is None:
                raise ValueError("--foxglove: the service needs an address to listen on, HOST:PORT")
            check_address(foxglove, insecure)
        if name == process_table.ROS2 and ros2 is None:
            raise ValueError("--ros2: the service needs a domain, ROS_DOMAIN_ID of the nodes")
        if name == process_table.MAVLINK:
            check_links(mavlink, mavlink_key)
        loaded = decided(scene, [*(set_ or []), *plan_options.overrides(plan or [], scene, set_ or [])])
        setup = resolve(loaded, plan_options.commands(plan or [], loaded))
        if entry.lock_step and entry.name not in setup.services:
            typer.echo(f"{name}: {scene} does not call for it")  # compose starts every service there is
            return
        take_part(
            ProcessSpec(
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
                foxglove=foxglove or "",
                ros2=ros2,
                ros2_router=check_ros2(ros2, ros2_router, insecure),
                external=elsewhere(table),
                keys=str(keys.absolute()) if keys else "",
            )
        )
