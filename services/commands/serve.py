"""`lapwing service`: one service of a scene, as `run` starts them all."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from services.commands.app import app
from services.commands.errors import user_errors
from services.commands.links import mavlink_options
from services.commands.options import (
    Insecure,
    MavlinkKey,
    MavlinkUrls,
    Overrides,
    PlanFile,
    SceneFile,
    Space,
    Speed,
    parse_speed,
)

if TYPE_CHECKING:
    pass


@app.command()
def service(
    name: Annotated[str, typer.Argument(metavar="NAME", help="plant, sensors, autopilot, ...")],
    scene: SceneFile,
    peers: Annotated[str, typer.Option(metavar="TABLE", help="name=endpoint,... of all participants")],
    set_: Overrides = None,
    space: Space = "lapwing",
    speed: Speed = None,
    log: Annotated[Path | None, typer.Option(metavar="FILE", help="the recorder's MCAP log")] = None,
    core: Annotated[int | None, typer.Option(metavar="N", help="the core that all lock-step services share")] = None,
    open_: Annotated[list[str] | None, typer.Option("--open", metavar="ENDPOINT", help="the router's door")] = None,
    mavlink: MavlinkUrls = None,
    mavlink_key: MavlinkKey = None,
    insecure: Insecure = False,
    with_parent: Annotated[bool, typer.Option("--with-parent", help="end when standard input closes")] = False,
    plan: PlanFile = None,
) -> None:
    """Run one service of a scene (`run` starts them all)."""
    from services.bus import ZenohBus, mesh
    from services.flight import parse_peers
    from services.launcher import WATCHER, check_space
    from services.plan import operator
    from services.process import Process, Stopped, run_lockstep
    from services.scene import load
    from services.table import MAVLINK, RECORDER, lockstep_services, modules

    with user_errors():
        check_space(space)
        table = parse_peers(peers)
        if name not in modules():
            raise ValueError(f"unknown service {name}; expected one of {', '.join(modules())}")
        if name not in table:
            raise ValueError(f"--peers: no endpoint for {name} itself")
        loaded = load(scene, set_ or [])
        flying = lockstep_services(loaded)
        if name not in flying and hasattr(modules()[name], "create"):
            typer.echo(f"{name}: {scene} does not call for it")  # compose starts every service there is
            return
        listen, connect = mesh(name, table)
        with ZenohBus([*listen, *(open_ or [])], connect, getattr(modules()[name], "MODE", "peer")) as bus:
            watched = WATCHER in table and not with_parent
            others = [*flying, RECORDER, WATCHER] if watched else [*flying, RECORDER]
            process = Process(name, loaded, bus, space, others, parse_speed(speed), core)
            if with_parent:
                process.end_with_parent()
            elif watched:
                process.end_with(WATCHER)
            try:
                if name in flying:
                    flying[name].prepare()
                    run_lockstep(process, flying[name], operator(plan))
                elif name == MAVLINK:
                    options = mavlink_options(mavlink, mavlink_key, insecure, parse_speed(speed))
                    modules()[name].run(process, options, operator(plan)(0))
                else:
                    modules()[name].run(process, log)
            except Stopped:
                pass
