"""`lapwing run`: fly a scene, record it, and report."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from services.commands.app import app
from services.commands.choice import decided, warn_of_gains
from services.commands.errors import user_errors
from services.commands.files import check_distinct, check_writable, left_as_it_was, log_path
from services.commands.links import mavlink_arguments
from services.commands.options import (
    Insecure,
    MavlinkKey,
    MavlinkUrls,
    Overrides,
    Peers,
    PlanFile,
    SceneFile,
    Space,
    Speed,
    parse_speed,
)

if TYPE_CHECKING:
    from services.scene import Scene


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
    space: Space = "lapwing",
    peers: Peers = None,
    open_: Annotated[
        str | None, typer.Option("--open", metavar="ENDPOINT", help="let Zenoh clients listen in: tcp/127.0.0.1:7447")
    ] = None,
    mavlink: MavlinkUrls = None,
    mavlink_key: MavlinkKey = None,
    insecure: Insecure = False,
    plan: PlanFile = None,
) -> None:
    """Fly a scene, record it, and report."""
    from services import flight
    from services.launcher import WATCHER
    from services.plan import OPERATED
    from services.plan import read as read_plan
    from services.sections import Run
    from services.table import RECORDER, lockstep_services

    with user_errors():
        if mode not in ("processes", "single"):
            raise ValueError(f"--mode {mode}: expected processes or single")
        if mode == "single" and (peers is not None or open_ is not None):
            raise ValueError("--mode single: has no network; leave out --peers and --open")
        if mavlink and (mode == "single" or peers is not None):
            raise ValueError("--mavlink: belongs to a run in processes; with --peers start the service mavlink instead")
        if open_ is not None:
            flight.check_endpoint("--open", open_)
        link = mavlink_arguments(mavlink, mavlink_key, insecure)
        set_ = [*(set_ or []), *(OPERATED if plan else ["autopilot.operator=true"] if mavlink else [])]
        if plan:
            read_plan(plan)
        loaded, overrides = decided(scene, set_)
        warn_of_gains(loaded)
        speed = speed or (str(loaded[Run].speed) if loaded[Run].speed else "1" if mavlink else None)
        pace = parse_speed(speed)
        needed = [*lockstep_services(loaded), RECORDER, WATCHER]
        table = None if peers is None else flight.parse_peers(peers, needed)
        check_distinct({"SCENE": scene, "--log": log, "--json": json})
        path = log_path(loaded, log, exists=table is not None)
        check_writable(json)
        _fly(loaded, overrides, mode, speed, pace, path, space, table, json, open_, link, plan)


def _fly(
    scene: "Scene",
    overrides: list[str],
    mode: str,
    speed: str | None,
    pace: float | None,
    log: Path,
    space: str,
    peers: dict[str, str] | None,
    json: Path | None,
    door: str | None,
    link: list[str],
    plan: Path | None,
) -> None:
    from rich.console import Console

    from services import flight, summary
    from services.plan import operator
    from services.progress import Display
    from services.sections import Run
    from services.table import MAVLINK
    from studies.flown import Flown
    from studies.report import write as write_report

    core = flight.shared_core(scene)

    def command(name: str) -> list[str]:
        own = {"recorder": ["--log", str(log)], "router": ["--open", str(door)], MAVLINK: link}
        extra = [*own.get(name, []), *(["--plan", str(plan)] if plan else [])]
        pacing = ["--speed", speed] if speed else []
        pacing += ["--core", str(core)] if core is not None else []
        return ["service", name, *flight.scene_arguments(scene.path, overrides), "--space", space, *pacing, *extra]

    console = Console()
    if not peers:
        flight.prepare(scene, console.print)
    with left_as_it_was(log), Display(console, scene[Run].duration) as display:
        if mode == "single":
            simulated, wall = flight.fly_single(scene, log, pace, display, operator(plan))
        elif peers:
            simulated, wall = flight.fly_joined(scene, peers, space, display)
        else:
            simulated, wall = flight.fly_processes(
                scene, command, space, display, door is not None, [MAVLINK] if link else []
            )
    flown = Flown(log)
    result = {
        "scene": scene.name,
        "seed": scene[Run].seed,
        "mode": mode,
        "digest": flown.digest,
        "sim_time_s": simulated,
        "wall_time_s": wall,
        "real_time_factor": simulated / wall if wall else 0.0,
        "rmse": flown.rmse(),
        "landed": flown.landed,
        "log": str(log),
        "report": str(write_report(log)),
    }
    if json:
        summary.write_json(json, result)
    summary.show(console, scene, result)
