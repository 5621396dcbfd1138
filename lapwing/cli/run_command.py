"""`lapwing run`: fly a scene, record it, and report."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from lapwing.cli import plan_options
from lapwing.cli.app import app
from lapwing.cli.endpoint_checks import check_endpoints, check_external, check_links, check_ros2
from lapwing.cli.error_exit import FLIGHT_FAILED, fail, user_errors
from lapwing.cli.mode_options import check_mode
from lapwing.cli.options import (
    FoxgloveAddress,
    Insecure,
    KeyPrefix,
    Keys,
    MavlinkKey,
    MavlinkUrls,
    Overrides,
    Peers,
    PlanFiles,
    Ros2Domain,
    Ros2Router,
    SceneFile,
    Speed,
    parse_speed,
)
from lapwing.cli.output_paths import (
    check_distinct,
    check_log,
    claim,
    claim_report,
    modification_time,
    remove_on_failure,
    reserve_log,
)
from lapwing.cli.preflight import decided, warn_of_gains
from lapwing.cosim.processes.child_process import Child, started_early

if TYPE_CHECKING:
    from lapwing.flight import Flight
    from lapwing.runs.observer import Elapsed
    from lapwing.services.process_main import ProcessSpec


@app.command()
def run(
    scene: SceneFile,
    set_: Overrides = None,
    speed: Speed = None,
    realtime: Annotated[
        bool, typer.Option("--realtime", help="at speed 1, in the scheduler's real-time class where that is allowed")
    ] = False,
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
        str | None, typer.Option("--open", metavar="ENDPOINT", help="let Zenoh clients listen in: tls/127.0.0.1:7447")
    ] = None,
    mavlink: MavlinkUrls = None,
    mavlink_key: MavlinkKey = None,
    insecure: Insecure = False,
    view: Annotated[bool, typer.Option("--view", help="show the flight in the browser while it goes on")] = False,
    foxglove: FoxgloveAddress = None,
    ros2: Ros2Domain = None,
    ros2_router: Ros2Router = None,
    keys: Keys = None,
    plan: PlanFiles = None,
    external: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME=ENDPOINT", help="a service that is a program of your own, listening there"),
    ] = None,
    run_: Annotated[
        int | None, typer.Option("--run", metavar="N", help="fly a run of --campaign again, to the bit")
    ] = None,
    campaign: Annotated[Path | None, typer.Option(metavar="DIR", help="the folder of the campaign of --run")] = None,
) -> None:
    """Fly a scene, record it, and report."""
    asked = {"router": bool(open_), "mavlink": bool(mavlink), "foxglove": bool(foxglove), "ros2": ros2 is not None}
    with user_errors(), _started_early(mode == "processes" and peers is None, **asked) as early:
        from lapwing.cosim.executors.realtime import why_not
        from lapwing.cosim.processes.run_monitor import MONITOR
        from lapwing.runs.distributed_run import check_complete, check_endpoint, elsewhere, parse_external, parse_peers
        from lapwing.services.common.run_schema import Run
        from lapwing.services.common.success_criteria import Success
        from lapwing.services.process_main import ProcessSpec
        from lapwing.services.process_table import needed
        from lapwing.services.ros2.schema import Bus
        from lapwing.services.scene_resolver import load, resolve
        from lapwing.studies.metrics import joint_end_state, metrics

        links = {"--mavlink": mavlink, "--external": external, "--foxglove": foxglove, "--view": view}
        check_mode(
            mode, peers is not None, open_ is not None, {**links, "--realtime": realtime, "--ros2": ros2 is not None}
        )
        if realtime and speed == "max":
            raise ValueError("--realtime: belongs to a run that keeps a speed; leave out --speed max")
        if open_ is not None:
            check_endpoint("--open", open_)
        table = None if peers is None else parse_peers(peers)
        opened = [*([open_] if open_ else []), *(table or {}).values()]
        check_endpoints("--peers" if table else "--open", opened, keys, insecure)
        if keys and not opened:
            raise ValueError("--keys: expected with --open or --peers")
        check_external(external or [], insecure)
        check_links(mavlink, mavlink_key)
        if foxglove is not None:
            from lapwing.services.foxglove.server import check_address

            check_address(foxglove, insecure)
        set_ = [
            *(set_ or []),
            *(
                plan_options.overrides(plan, scene, set_ or [])
                if plan
                else ["autopilot.operator=true"]
                if mavlink
                else []
            ),
        ]
        if (run_ is None) != (campaign is None):
            raise ValueError("--run and --campaign: belong together; expected both")
        if run_ is not None and campaign is not None:
            from lapwing.studies.campaign import single_run  # which needs scipy

            loaded = load(single_run.scene_of_run(scene, run_, campaign), set_)
        else:
            loaded = decided(scene, set_)
        if ros2 is None and loaded.has(Bus) and loaded[Bus].ros2:
            ros2 = loaded[Bus].ros2_domain
            check_mode(mode, peers is not None, False, {"--ros2": True})
        warn_of_gains(loaded)
        router = check_ros2(ros2, ros2_router, insecure)
        setup = resolve(loaded, plan_options.commands(plan or [], loaded))
        paced = mavlink or view or realtime or ros2 is not None
        speed = speed or (str(loaded[Run].speed) if loaded[Run].speed else "1" if paced else None)
        if table is not None:
            check_complete(table, [*needed(setup, elsewhere(table)), MONITOR])
        path = log or reserve_log(loaded.name)
        page = report or path.with_suffix(".html")
        check_distinct({"SCENE": scene, "--log": path, "--json": json, "--report": page})
        if table is None:
            check_log(path)
        claim_report("--report", page)
        claim(json)
        given = ProcessSpec(
            name=MONITOR,
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
            foxglove=foxglove or "",
            ros2=ros2,
            ros2_router=router,
            external=elsewhere(table) if table else parse_external(external or [], setup),
            keys=str(keys.absolute()) if keys else "",
            realtime=realtime,
        )
        if realtime and (reason := why_not()):
            given = given._replace(realtime=False)
            typer.echo(f"lapwing: --realtime: no real-time class: {reason}", err=True)
        before = modification_time(path)

        def conclude(elapsed: "Elapsed | None") -> "list[Flight]":
            from lapwing.cli import run_summary  # not before the flight, whose start would wait for it
            from lapwing.runs.log_events import add_events

            mine = elapsed is not None or modification_time(path) != before
            flights = run_summary.fleet(path) if mine else []
            for flown in flights:
                if flown.digest and not flown.has("events"):  # the log has its end
                    add_events(path, flown)
            if flights:
                run_summary.conclude(loaded, given, flights, elapsed, json, report)
            return flights

        try:
            elapsed = _fly(given, path, view, early)
        except BaseException:  # what was flown before an error or Ctrl-C has its outcome, too
            with suppress(ValueError):  # the first error is told
                conclude(None)
            raise
        flights = conclude(elapsed)
        if flights and run_ is not None and campaign is not None:
            from lapwing.studies.campaign import single_run

            there = single_run.end_state_of(run_, campaign)
            which, same = f"run {run_} of {campaign}", there == joint_end_state(flights)
            if there and not same and not set_:
                fail(f"{which}: ends in another state than there", FLIGHT_FAILED)
            ended = "the same end, to the bit" if same else "ends in another state, with --set"
            typer.echo(f"{which}: {ended if there else 'it has not been flown there yet'}")
        for flown, flier in zip(flights, loaded.vehicles or (loaded,), strict=False):
            if unmet := flier[Success].unmet(metrics(flown)):
                of = f" of {flown.vehicle}" if loaded.vehicles else ""
                why = f"{flown.outcome.kind}; success.require: {'; '.join(unmet)}"
                fail(f"the flight{of} has failed: {why}", FLIGHT_FAILED)


@contextmanager
def _started_early(in_processes: bool, **options: bool) -> Iterator[dict[str, Child]]:
    """The processes of a run, before the scene is read: they need not import what this one has imported by then.

    Args:
        in_processes: whether there will be any.
        options: whether one is asked for that runs only then; it imports what it alone needs while the scene is read.
    """
    if not in_processes:
        yield {}
        return
    from lapwing.services.process_main import import_ahead
    from lapwing.services.process_table import usual

    names = usual()
    import_ahead(names)
    with started_early([*names, *(name for name, wanted in options.items() if wanted)]) as early:
        yield early


def _fly(given: "ProcessSpec", log: Path, view: bool, early: dict[str, Child]) -> "Elapsed":
    from lapwing.cli.progress import Display
    from lapwing.services.process_table import FOXGLOVE, MAVLINK, ROS2
    from lapwing.studies.terminal import console

    setup = given.setup
    with remove_on_failure(log), Display(console(), setup.duration) as display:
        if given.mode == "single":
            from lapwing.runs.single_process_run import fly_single

            return fly_single(setup, log, given.sources, given.speed, display)
        links = {MAVLINK: bool(given.mavlink), FOXGLOVE: bool(given.foxglove), ROS2: given.ros2 is not None}
        beside = [name for name, wanted in links.items() if wanted or name in given.peers]
        fly: Callable[..., Elapsed]
        if given.peers:
            from lapwing.runs.distributed_run import fly_joined

            fly = partial(fly_joined, given, display)
        else:
            from lapwing.runs.multi_process_run import fly_processes

            fly = partial(fly_processes, given, display, beside, early=early)
        with ExitStack() as stack:
            shows = []
            if view:
                import webbrowser

                from lapwing.runs.live_page import LivePage

                page = stack.enter_context(LivePage(setup))
                display.say(f"live: {page.address}")
                webbrowser.open(page.address)
                shows.append(page.show)
            if not (view or FOXGLOVE in beside or ROS2 in beside):
                return fly()
            from lapwing.runs.live_feed import LiveFeed

            return fly(live=LiveFeed(setup, shows).observe)
