"""`lapwing run`: fly a scene, record it, and report."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from lapwing.cli.app import app
from lapwing.cli.choice import decided, warn_of_gains
from lapwing.cli.errors import FLIGHT_FAILED, fail, user_errors
from lapwing.cli.files import check_distinct, check_report, check_writable, left_as_it_was, log_path, written
from lapwing.cli.links import check_links
from lapwing.cli.options import (
    Insecure,
    KeyPrefix,
    MavlinkKey,
    MavlinkUrls,
    Overrides,
    Peers,
    PlanFile,
    SceneFile,
    Speed,
    parse_speed,
)

if TYPE_CHECKING:
    from lapwing.runs.observer import Elapsed
    from services.participant import Participation


@app.command()
def run(
    scene: SceneFile,
    set_: Overrides = None,
    speed: Speed = None,
    mode: Annotated[
        str, typer.Option(metavar="processes|single", help="one process a service, or one for all")
    ] = "processes",
    json: Annotated[Path | None, typer.Option(metavar="FILE", help="write the figures of the run as JSON")] = None,
    log: Annotated[Path | None, typer.Option(metavar="FILE", help="the MCAP log [recordings/SCENE_TIME.mcap]")] = None,
    report: Annotated[
        Path | None, typer.Option(metavar="FILE.html|pdf|png", help="the report [beside the log, .html]")
    ] = None,
    key_prefix: KeyPrefix = "lapwing",
    peers: Peers = None,
    open_: Annotated[
        str | None, typer.Option("--open", metavar="ENDPOINT", help="let Zenoh clients listen in: tcp/127.0.0.1:7447")
    ] = None,
    mavlink: MavlinkUrls = None,
    mavlink_key: MavlinkKey = None,
    insecure: Insecure = False,
    plan: PlanFile = None,
    external: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME=ENDPOINT", help="a service that is a program of your own, listening there"),
    ] = None,
) -> None:
    """Fly a scene, record it, and report."""
    from cosim.watch import WATCHER
    from lapwing.cli import summary
    from lapwing.runs.joined import check_endpoint, parse_external, parse_peers
    from services.common.plan import OPERATED
    from services.common.plan import read as read_plan
    from services.common.sections import Run
    from services.common.vehicle import start_height
    from services.participant import Participation
    from services.processes import needed
    from services.table import resolve

    with user_errors():
        if mode not in ("processes", "single"):
            raise ValueError(f"--mode {mode}: expected processes or single")
        if mode == "single" and (peers is not None or open_ is not None):
            raise ValueError("--mode single: has no network; leave out --peers and --open")
        if mavlink and (mode == "single" or peers is not None):
            raise ValueError("--mavlink: belongs to a run in processes; with --peers start the service mavlink instead")
        if external and (mode == "single" or peers is not None):
            raise ValueError("--external: belongs to a run in processes; with --peers leave that service out")
        if open_ is not None:
            check_endpoint("--open", open_)
        check_links(mavlink, mavlink_key, insecure)
        set_ = [*(set_ or []), *(OPERATED if plan else ["autopilot.operator=true"] if mavlink else [])]
        loaded = decided(scene, set_)
        commands = tuple(read_plan(plan, start_height(loaded))) if plan else ()
        warn_of_gains(loaded)
        setup = resolve(loaded, commands)
        speed = speed or (str(loaded[Run].speed) if loaded[Run].speed else "1" if mavlink else None)
        table = None if peers is None else parse_peers(peers, [*needed(setup), WATCHER])
        check_distinct({"SCENE": scene, "--log": log, "--json": json, "--report": report})
        path = log_path(loaded, log, exists=table is not None)
        check_writable(json)
        check_report("--report", report)
        given = Participation(
            name=WATCHER,
            setup=setup,
            peers=table or {},
            key_prefix=key_prefix,
            speed=parse_speed(speed),
            log=str(path.absolute()),
            sources={name: content.decode() for name, content in loaded.sources.items()},
            mode=mode,
            open=(open_,) if open_ else (),
            mavlink=tuple(mavlink or ()),
            mavlink_key=str(mavlink_key.absolute()) if mavlink_key else "",
            insecure=insecure,
            external=parse_external(external or [], setup),
        )
        elapsed, before = None, written(path)
        try:
            elapsed = _fly(given, path)
        finally:  # what was flown before an error or Ctrl-C has its verdict, too
            mine = elapsed is not None or (table is None and written(path) != before)
            flown = summary.flown(path) if mine else None
            if flown is not None:
                summary.conclude(loaded, given, flown, elapsed, json, report)
        if flown is not None and flown.verdict.kind in loaded[Run].failed:
            fail(f"the flight has failed: {flown.verdict.kind}", FLIGHT_FAILED)


def _fly(given: "Participation", log: Path) -> "Elapsed":
    from lapwing.cli.progress import Display
    from services.processes import MAVLINK
    from studies.terminal import console

    setup = given.setup
    with left_as_it_was(log), Display(console(), setup.duration) as display:
        if given.mode == "single":
            from lapwing.runs.single import fly_single

            return fly_single(setup, log, given.sources, given.speed, display)
        if given.peers:
            from lapwing.runs.joined import fly_joined

            return fly_joined(setup, given.peers, given.key_prefix, display)
        from lapwing.runs.processes import fly_processes

        return fly_processes(given, display, [MAVLINK] if given.mavlink else [])
