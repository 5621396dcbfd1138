"""`lapwing run`: fly a scene, record it, and report."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from lapwing.cli import run_options
from lapwing.cli.app import app
from lapwing.cli.options import absolute, check_pace, parse_speed, with_options
from lapwing.cli.output_paths import check_distinct, check_log, claim, claim_report, remove_on_failure, reserve_log
from lapwing.cli.preflight import (
    check_firmware_program,
    check_gains,
    print_warnings,
    with_solver_selected,
)
from lapwing.cli.run_options import MULTI_PROCESS, SINGLE_PROCESS, RunOptions
from lapwing.cosim.optional_packages import require
from lapwing.cosim.output_lock import modification_time
from lapwing.cosim.processes.child_process import Child, start_early, terminate_unused

if TYPE_CHECKING:
    from lapwing.api.flight import Flight
    from lapwing.cosim.scene import Scene
    from lapwing.runs.observer import Elapsed
    from lapwing.services.process_main import ProcessSpec


@app.command()
@with_options
def run(options: RunOptions) -> None:
    """Fly a scene, record it, and report.

    Exit codes: 1 the run failed, 2 invalid input, 4 the flight does not meet success.require of the scene.
    """
    from lapwing.services.common import foreign_code

    if options.mavlink:
        require("pymavlink")
    with foreign_code.permission(options.allow_code), _start_early(options) as early:
        options.validate()
        scene, options, spec = _prepare(options)
        if options.mode == SINGLE_PROCESS:
            terminate_unused(early)
        flights = _fly_and_report(options, scene, spec, early)
        if flights:
            from lapwing.cli import run_summary  # imported after the flight, whose start it would delay

            run_summary.compare_with_campaign(options, flights)
            run_summary.check_success(scene, flights)


def _prepare(options: RunOptions) -> "tuple[Scene, RunOptions, ProcessSpec]":
    """Return the scene, the options with those that it sets, and the specification of the run."""
    from lapwing.cosim.processes.watchdog import Watchdog
    from lapwing.services.common.firmware.schema import flown_by_firmware

    with Watchdog():  # user code is tried
        scene = _load(options)
        options = _with_ros2_of_scene(options, scene)
        options = replace(options, mode=options.mode_of(any(map(flown_by_firmware, scene.each_vehicle))))
        if options.shell and options.mode != SINGLE_PROCESS:
            raise ValueError(f"--shell: needs --mode {SINGLE_PROCESS}; leave out options that need processes")
        if not options.external:
            check_firmware_program(scene)
        check_gains(scene, options.force)
        return scene, options, _spec(options, scene)


@contextmanager
def _start_early(options: RunOptions) -> Iterator[dict[str, Child]]:
    """Start the processes of a run before the scene is read, so that they import their modules at the same time."""
    if options.mode == SINGLE_PROCESS or options.endpoints is not None:
        yield {}
        return
    from lapwing.services.process_main import import_ahead
    from lapwing.services.process_table import FOXGLOVE, MAVLINK, ROS2, ROUTER, always_required

    optional = {
        ROUTER: options.listen,
        MAVLINK: options.mavlink,
        FOXGLOVE: options.foxglove,
        ROS2: options.ros2 is not None,
    }
    names = always_required()
    import_ahead(names)
    with start_early([*names, *(name for name, requested in optional.items() if requested)]) as early:
        yield early


def _load(options: RunOptions) -> "Scene":
    """Return the scene with the overrides of --set, --plan, --mavlink and --run."""
    overrides = list(options.set_ or [])
    if options.firmware_schedule is not None:
        overrides.append(f"autopilot.schedule={options.firmware_schedule}")
    if options.shell:
        overrides.append("autopilot.shell=true")
    if options.plan:
        overrides += run_options.plan_overrides(options.plan, options.scene, overrides)
    elif options.mavlink:
        overrides += ["autopilot.accept_commands=true"]
    if options.run_ is None or options.campaign is None:
        return with_solver_selected(options.scene, overrides)
    from lapwing.services.scene_resolver import load
    from lapwing.studies.campaign import single_run  # imports scipy

    return load(single_run.scene_of_run(options.scene, options.run_, options.campaign), overrides)


def _with_ros2_of_scene(options: RunOptions, scene: "Scene") -> RunOptions:
    from lapwing.services.ros2.schema import Ros2

    if options.ros2 is not None or not scene.has(Ros2) or not scene[Ros2].enabled:
        return options
    options = replace(options, ros2=scene[Ros2].domain_id)
    options.validate_mode()
    options.validate_links()
    return options


def _spec(options: RunOptions, scene: "Scene") -> "ProcessSpec":
    """Return the specification of the run; raise ValueError for files that cannot be written."""
    from lapwing.cosim.executors.realtime import unavailable_reason
    from lapwing.cosim.processes.run_monitor import MONITOR
    from lapwing.runs.distributed_run import check_complete, external_services, parse_external
    from lapwing.services.common import foreign_code
    from lapwing.services.common.schemas.run_schema import Run
    from lapwing.services.process_main import ProcessSpec
    from lapwing.services.process_table import foreign_firmware, required_processes
    from lapwing.services.scene_resolver import resolve

    config = resolve(scene, run_options.plan_commands(options.plan or [], scene, _print_note))
    print_warnings(scene, config)
    if options.mavlink and (firmware := foreign_firmware(config)):
        message = f"--mavlink: {firmware} flies the vehicle and has its own MAVLink or MSP links"
        raise ValueError(f"{message}; connect the ground station to the firmware")
    foreign_code.check(config)
    speed, table, realtime = parse_speed(options.speed), options.table, options.realtime
    if options.speed is None:
        paced = options.mavlink or options.view or realtime or options.ros2 is not None
        speed = scene[Run].real_time_factor or (1.0 if paced else None)
    source = f"run.real_time_factor {speed}" if options.speed is None else f"--speed {options.speed}"
    check_pace(source, speed, config.interval)
    if table is not None:
        check_complete(table, [*required_processes(config, external_services(table)), MONITOR])
    log = options.log or reserve_log(scene.name)
    if not log.name:
        raise ValueError(f"--log {log}: is a folder; expected the path of an output file")
    report = options.report or log.with_suffix(".html")
    check_distinct({"SCENE": options.scene, "--log": log, "--json": options.json, "--report": report})
    if table is None:
        check_log(log)
    claim_report("--report", report, None if options.report else log)
    claim(options.json)
    if realtime and (reason := unavailable_reason()):
        realtime = False
        typer.echo(f"lapwing: --realtime: no real-time class: {reason}", err=True)
    return ProcessSpec(
        name=MONITOR,
        config=config,
        peers=table or {},
        key_prefix=options.key_prefix,
        speed=speed,
        log=absolute(log),
        sources={name: content.decode() for name, content in scene.sources.items()},
        mode=options.mode or MULTI_PROCESS,
        open=(options.listen,) if options.listen else (),
        external=external_services(table) if table else parse_external(options.external or [], config),
        keys=absolute(options.keys),
        realtime=realtime,
        **options.spec,
    )


def _print_note(line: str) -> None:
    typer.echo(f"lapwing: {line}", err=True)


def _fly_and_report(
    options: RunOptions, scene: "Scene", spec: "ProcessSpec", early: dict[str, Child]
) -> "list[Flight]":
    """Fly and return the recorded flights. A failed or interrupted run is reported before its error.

    A run that its user ends after all vehicles have landed is complete.
    """
    from lapwing.cosim.config.provenance import ENDED
    from lapwing.cosim.processes.interrupt import Interrupted
    from lapwing.cosim.run_errors import RunFailed

    log = Path(spec.log) if options.log is None else options.log
    before = modification_time(log)

    def report(elapsed: "Elapsed | None", reason: str = "") -> "list[Flight]":
        from lapwing.cli import run_summary
        from lapwing.flights.log_events import add_events

        if elapsed is None and modification_time(log) == before:
            return []
        flights = run_summary.fleet(log)
        for flight in flights:
            if reason and flight.failure in ("", ENDED):  # a process that has died cannot say so in the log
                flight.failure = reason
            if flight.digest and not flight.has("events"):  # the log is complete
                add_events(log, flight)
        if flights:
            run_summary.report_results(scene, spec, flights, elapsed, options.json, options.report)
        return flights

    try:
        elapsed = _fly(options, spec, log, early)
    except BaseException as error:
        flights: list[Flight] = []
        with suppress(ValueError):  # the first error is reported
            flights = report(None, str(error) if isinstance(error, RunFailed) else "")
        if modification_time(log) != before:
            _advise_recovery(log)
        if isinstance(error, Interrupted) and flights and all(flight.landed for flight in flights):
            return flights
        raise
    return report(elapsed)


def _advise_recovery(log: Path) -> None:
    """Print the command that completes a truncated log, which some programs reject."""
    from lapwing.cosim.log.mcap_contents import has_footer

    if log.is_file() and not has_footer(log):
        typer.echo(f"{log}: incomplete, some programs reject it; run `lapwing recover {log}`")


def _fly(options: RunOptions, spec: "ProcessSpec", log: Path, early: dict[str, Child]) -> "Elapsed":
    from lapwing.cli.progress import RunProgress
    from lapwing.services.process_table import FOXGLOVE, MAVLINK, ROS2
    from lapwing.views.terminal import console

    config = spec.config
    with remove_on_failure(log), RunProgress(console(), config.duration) as display, ExitStack() as stack:
        if spec.mode == SINGLE_PROCESS:
            from lapwing.runs.single_process_run import fly_single

            return fly_single(config, log, spec.sources, spec.speed, display)
        links = {MAVLINK: spec.mavlink, FOXGLOVE: spec.foxglove, ROS2: spec.ros2 is not None}
        auxiliary = [name for name, requested in links.items() if requested or name in spec.peers]
        fly: Callable[..., Elapsed]
        if spec.peers:
            from lapwing.runs.distributed_run import monitor_run

            fly = partial(monitor_run, spec, display)
        else:
            from lapwing.runs.multi_process_run import fly_processes

            fly = partial(fly_processes, spec, display, auxiliary, early=early)
        displays = []
        observers = []
        if options.view:
            import webbrowser

            from lapwing.views.live.live_page import LivePage

            page = stack.enter_context(LivePage(config))
            display.say(f"live: {page.address}")
            if page.operated:
                display.say("fly it in that page: arrows and W A S D or a gamepad; T takes off, L lands, R returns")
            webbrowser.open(page.address)
            displays.append(page.show)
            observers.append(page.follow)
        if not (displays or FOXGLOVE in auxiliary or ROS2 in auxiliary):
            return fly()
        from lapwing.views.live.live_feed import LiveFeed

        observers.append(LiveFeed(config, displays).observe)
        return fly(live=lambda watch: [observe(watch) for observe in observers])
