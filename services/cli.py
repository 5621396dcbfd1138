"""`lapwing`: every command of the project, thin functions that call what they are named after.

This is the one place that knows both the services and the studies. Modules are imported where they are used, so that a
service's process starts quickly.
"""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from services.scene import Scene

app = typer.Typer(
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)

SceneFile = Annotated[Path, typer.Argument(metavar="SCENE", help="a scene file (TOML)")]
Overrides = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help="override a key of the scene: solver.step=0.001 (repeatable)"),
]
Space = Annotated[str, typer.Option(metavar="NAME", help="key space of the run on the bus")]
Speed = Annotated[
    str | None, typer.Option(metavar="1|N|max", help="simulated seconds per second; max: as fast as it goes")
]
Peers = Annotated[
    str | None,
    typer.Option(metavar="TABLE", help="name=endpoint,... of all participants, when they are started separately"),
]

USER_ERROR = 2
# Of unknown options and missing arguments; not every version of typer exports the class itself.
UsageError: type[typer.BadParameter] = typer.BadParameter.__base__  # type: ignore[assignment]


def _show_version(wanted: bool) -> None:
    from services.provenance import package_version

    if wanted:
        typer.echo(f"lapwing {package_version()}")
        raise typer.Exit


@app.callback()
def options(
    version: Annotated[
        bool, typer.Option("--version", callback=_show_version, is_eager=True, help="show the version and end")
    ] = False,
) -> None:
    """Co-simulation of multirotors in lock step over Zenoh, recorded to MCAP."""


@contextmanager
def user_errors() -> Iterator[None]:
    """Turn what the user can mend into one line and exit code 2, a failed run into one line and exit code 1."""
    from services.bus import BusError
    from services.flight import Interrupted
    from services.launcher import RunFailed
    from services.lockstep import LockStepError

    try:
        yield
    except (ValueError, BusError) as error:
        _fail(str(error), USER_ERROR)
    except (RunFailed, LockStepError) as error:
        _fail(str(error), 1)
    except Interrupted as interrupted:
        _fail(str(interrupted), 128 + interrupted.signal)


def _fail(message: str, code: int) -> None:
    typer.echo(f"lapwing: {' '.join(message.split())}", err=True)  # one line, whatever the message quotes
    raise SystemExit(code)


def parse_speed(text: str | None) -> float | None:
    """Simulated seconds per second, None for as fast as it goes.

    Raises:
        ValueError: no positive number and not "max".
    """
    if text is None or text == "max":
        return None
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 0.0 < value < float("inf"):
        raise ValueError(f"--speed {text}: expected a number above 0, or max")
    return value


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
) -> None:
    """Fly a scene, record it, and report."""
    from services import flight
    from services.launcher import WATCHER
    from services.scene import load
    from services.table import RECORDER, lockstep_services

    with user_errors():
        if mode not in ("processes", "single"):
            raise ValueError(f"--mode {mode}: expected processes or single")
        if mode == "single" and (peers is not None or open_ is not None):
            raise ValueError("--mode single: has no network; leave out --peers and --open")
        if open_ is not None:
            flight.check_endpoint("--open", open_)
        loaded = load(scene, set_ or [])
        pace = parse_speed(speed)
        needed = [*lockstep_services(loaded), RECORDER, WATCHER]
        table = None if peers is None else flight.parse_peers(peers, needed)
        _check_distinct({"SCENE": scene, "--log": log, "--json": json})
        path = _log_path(loaded, log, exists=table is not None)
        _check_writable(json)
        _fly(loaded, set_ or [], mode, speed, pace, path, space, table, json, open_)


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
) -> None:
    from rich.console import Console

    from services import flight, summary
    from services.progress import Display
    from services.sections import Run
    from studies.flown import Flown
    from studies.report import write as write_report

    core = flight.shared_core(scene)

    def command(name: str) -> list[str]:
        extra = ["--log", str(log)] if name == "recorder" else ["--open", str(door)] if name == "router" else []
        pacing = ["--speed", speed] if speed else []
        pacing += ["--core", str(core)] if core is not None else []
        return ["service", name, *flight.scene_arguments(scene.path, overrides), "--space", space, *pacing, *extra]

    console = Console()
    if not peers:
        flight.prepare(scene, console.print)
    with _left_as_it_was(log), Display(console, scene[Run].duration) as display:
        if mode == "single":
            simulated, wall = flight.fly_single(scene, log, pace, display)
        elif peers:
            simulated, wall = flight.fly_joined(scene, peers, space, display)
        else:
            simulated, wall = flight.fly_processes(scene, command, space, display, door is not None)
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


def _log_path(scene: "Scene", given: Path | None, exists: bool) -> Path:
    """Where the log goes; a path that cannot be written is refused now, not after the flight."""
    import time

    stamp = time.strftime("%Y-%m-%dT%H-%M-%S")
    path = given or Path("recordings") / f"{scene.name}_{stamp}.mcap"
    if not exists:
        with _left_as_it_was(path):
            _check_writable(path)
    return path


@contextmanager
def _left_as_it_was(log: Path) -> Iterator[None]:
    """Make the folder of recordings where it is missing; leave neither it nor a log behind when a run is refused."""
    new_log, new_folder = not log.exists(), log.parent == Path("recordings") and not log.parent.exists()
    refused = False
    try:
        if new_folder:
            log.parent.mkdir()
        yield
    except OSError as error:
        raise ValueError(f"{log}: cannot be written: {(error.strerror or str(error)).lower()}") from None
    except ValueError:
        refused = True
        raise
    finally:
        if new_log and refused:
            log.unlink(missing_ok=True)
        if new_folder and log.parent.is_dir() and not any(log.parent.iterdir()):
            log.parent.rmdir()


def _check_distinct(paths: dict[str, Path | None]) -> None:
    names: dict[Path, str] = {}
    for option, path in paths.items():
        if path is not None and (other := names.setdefault(path.resolve(), option)) != option:
            raise ValueError(f"{option} {path}: is the same file as {other}; choose another")


def _check_writable(path: Path | None) -> None:
    if path is None:
        return
    if path.is_dir():
        raise ValueError(f"{path}: is a folder; expected the name of a file to write")
    there = path.exists()
    try:
        path.open("ab").close()
    except OSError as error:
        raise ValueError(f"{path}: cannot be written: {(error.strerror or str(error)).lower()}") from None
    if not there:
        path.unlink()


def _check_plot(path: Path | None) -> None:
    if path is not None and path.suffix not in (".png", ".svg", ".pdf"):
        raise ValueError(f"--plot {path}: expected a name that ends in .png, .svg or .pdf")
    _check_writable(path)


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
    with_parent: Annotated[bool, typer.Option("--with-parent", help="end when standard input closes")] = False,
) -> None:
    """Run one service of a scene (`run` starts them all)."""
    from services.bus import ZenohBus, mesh
    from services.flight import parse_peers
    from services.launcher import WATCHER, check_space
    from services.process import Process, Stopped, run_lockstep
    from services.scene import load
    from services.table import RECORDER, lockstep_services, modules

    with user_errors():
        check_space(space)
        table = parse_peers(peers)
        if name not in modules():
            raise ValueError(f"unknown service {name}; expected one of {', '.join(modules())}")
        if name not in table:
            raise ValueError(f"--peers: no endpoint for {name} itself")
        loaded = load(scene, set_ or [])
        flying = lockstep_services(loaded)
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
                    run_lockstep(process, flying[name])
                else:
                    modules()[name].run(process, log)
            except Stopped:
                pass


@app.command()
def scenes(folder: Annotated[Path, typer.Argument(help="where to look")] = Path("scenes")) -> None:
    """List the scenes, a line each."""
    from services.scene import SceneError, load
    from services.sections import Run

    with user_errors():
        paths = sorted(folder.glob("*.toml"))
        if not paths:
            raise ValueError(f"{folder}: no scenes there; expected a folder with .toml files")
        width = max(len(str(path)) for path in paths)
        for path in paths:
            try:
                line = load(path)[Run].title
            except SceneError as error:
                line = f"(broken: {error})"
            typer.echo(f"{path!s:<{width}}  {line}")


@app.command()
def check(scene: SceneFile, set_: Overrides = None) -> None:
    """Validate a scene."""
    from services.scene import load
    from services.sections import Exchange, Run, Vehicle
    from services.table import lockstep_services

    with user_errors():
        loaded = load(scene, set_ or [])
        vehicle, exchange = loaded[Vehicle], loaded[Exchange]
        typer.echo(f"{scene}: ok")
        for label, line in {
            "title": loaded[Run].title or loaded.name,
            "vehicle": f"{vehicle.name}, {vehicle.airframe}",
            "effects": ", ".join(sorted(loaded.tables("effects"))) or "none",
            "sensors": ", ".join(sorted(loaded.tables("sensors"))) or "none",
            "services": f"{', '.join(lockstep_services(loaded))}; {exchange.rate} Hz, {exchange.coupling}",
        }.items():
            typer.echo(f"  {label:<9} {line}")


@app.command()
def warm(
    scenes: Annotated[
        list[Path] | None, typer.Argument(metavar="[SCENE]...", help="[scenes/delivery_mission.toml]")
    ] = None,
) -> None:
    """Compile what scenes need, so that their first run starts at once."""
    import time

    from services import flight
    from services.scene import load

    with user_errors():
        for path in scenes or [Path("scenes/delivery_mission.toml")]:
            started = time.perf_counter()
            flight.prepare(load(path), typer.echo)
            typer.echo(f"{path}: ready after {time.perf_counter() - started:.1f} s")


@app.command()
def report(log: Annotated[Path, typer.Argument(metavar="FILE", help="an MCAP log of a run")]) -> None:
    """Write an HTML report with plots beside a log."""
    from studies import report as study

    with user_errors():
        typer.echo(study.write(log))


@app.command()
def performance(
    subject: Annotated[Path, typer.Argument(metavar="SCENE|VEHICLE", help="a scene, or an airframe's TOML file")],
    json: Annotated[Path | None, typer.Option(metavar="FILE", help="write the figures as JSON")] = None,
) -> None:
    """Hover time, payload, range, ceiling, tilt and speed from the models, beside published figures."""
    from studies.performance import card, show, write_json

    with user_errors():
        _check_writable(json)
        figures = card(subject)
        show(figures)
        if json:
            write_json(json, figures)


@app.command()
def effects(
    scene: SceneFile,
    set_: Overrides = None,
    within: Annotated[float, typer.Option(metavar="M", help="how far the trajectory may change")] = 0.01,
    json: Annotated[Path | None, typer.Option(metavar="FILE", help="write the study as JSON")] = None,
    plot: Annotated[Path | None, typer.Option(metavar="FILE", help="draw it (PNG, SVG or PDF)")] = None,
) -> None:
    """What each effect of a scene costs and changes, and which of them it could do without."""
    from rich.console import Console

    from services.scene import load
    from studies.effects import show
    from studies.effects.study import study

    with user_errors():
        if not within > 0.0:
            raise ValueError(f"--within {within:g}: expected a distance above 0 m")
        _check_distinct({"SCENE": scene, "--json": json, "--plot": plot})
        _check_writable(json)
        _check_plot(plot)
        console = Console()
        found = study(load(scene, set_ or []), within, lambda text: console.print(text, highlight=False))
        show.show(console, found)
        if json:
            show.write_json(json, found)
        if plot:
            show.plot(plot, found)


@app.command()
def tune(
    scene: SceneFile,
    set_: Overrides = None,
    lift: Annotated[float, typer.Option(metavar="RAD/S", help="bandwidth of the height loop")] = 13.0,
    yaw: Annotated[float, typer.Option(metavar="RAD/S", help="bandwidth of the yaw loop")] = 22.0,
    attitude: Annotated[
        float, typer.Option(metavar="RAD/S", help="bandwidth of the inner roll and pitch loops")
    ] = 26.0,
    position: Annotated[float, typer.Option(metavar="RAD/S", help="bandwidth of the outer loops")] = 4.9,
    out: Annotated[
        Path | None, typer.Option(metavar="FILE", help="write the gain set (TOML), for a scene to name")
    ] = None,
) -> None:
    """Design gains about hover for given bandwidths, slowed down until 45 degrees and 6 dB hold in every loop."""
    from rich.console import Console

    from services.scene import load
    from studies.tune import study
    from studies.tune.design import Bandwidths

    with user_errors():
        _check_distinct({"SCENE": scene, "--out": out})
        _check_writable(out)
        if out and out.suffix != ".toml":
            raise ValueError(f"--out {out}: expected a name that ends in .toml")
        wanted = Bandwidths(lift, yaw, attitude, position)
        found = study.tune(load(scene, set_ or []), wanted, typer.echo)
        Console().print(study.table(found))
        if out:
            study.write(out, found.gains)


@app.command()
def replay(
    log: Annotated[Path, typer.Argument(metavar="FILE", help="an MCAP log of a run")],
    speed: Speed = "1",
    start: Annotated[float, typer.Option("--from", metavar="S", help="begin at this simulation time")] = 0.0,
    end: Annotated[float | None, typer.Option("--to", metavar="S", help="end at this simulation time")] = None,
    loop: Annotated[bool, typer.Option("--loop", help="begin again at the end")] = False,
    space: Space = "lapwing",
    listen: Annotated[str, typer.Option(metavar="ENDPOINT", help="where subscribers connect")] = "tcp/127.0.0.1:7447",
    record: Annotated[Path | None, typer.Option(metavar="FILE", help="also write what is published to a log")] = None,
) -> None:
    """Publish a log on Zenoh with its own timing, as the live run did."""
    from services.flight import Stop
    from services.launcher import key_space
    from services.replay.player import play
    from services.replay.schedule import Cut

    with user_errors():
        cut, pace = Cut.of(start, end), parse_speed(speed)
        if record and loop:
            raise ValueError("--record and --loop exclude each other: a log has an end")
        if record and record.resolve() == log.resolve():
            raise ValueError(f"--record {record}: is the log that is replayed; choose another file")
        _check_writable(record)
        with key_space(space), Stop() as stop:
            count = play(log, space, listen, cut, pace, loop, record, lambda: stop.number is not None)
            stop.check()
        typer.echo(f"{log}: {count} messages published" + (f", recorded to {record}" if record else ""))


def main() -> None:
    """Entry point of `lapwing`."""
    with user_errors():
        from services.flight import end_at_once

        end_at_once()
        try:
            app(sys.argv[1:] or ["--help"], standalone_mode=False)
        except UsageError as error:
            _fail(f"{error.format_message()} (see lapwing --help)", USER_ERROR)


if __name__ == "__main__":
    main()
