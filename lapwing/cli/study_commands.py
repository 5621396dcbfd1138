"""The studies: performance, effects, accuracy, stability, tune."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Annotated, Any

import typer

from lapwing.cli.app import app
from lapwing.cli.error_exit import user_errors
from lapwing.cli.options import Overrides, SceneFile
from lapwing.cli.output_paths import check_distinct, claim, claim_plot
from lapwing.studies.tune.bandwidths import Bandwidths

if TYPE_CHECKING:
    from rich.console import Console
    from rich.progress import Progress, TaskID

    from lapwing.cosim.scene import Scene
    from lapwing.runs.compile_notice import Compilation


def _study(
    name: str,
    subject: Path,
    json: Path | None,
    plot: Path | None,
    console: "Console",
    find: Callable[[], Any],
    module: ModuleType,
) -> None:
    """Refuse files that cannot be written, then study, show, and write what was asked for.

    Args:
        name: of the argument that says what is studied, for messages.
        subject: its value.
        json: file for the figures.
        plot: file for the picture.
        console: where it is shown.
        find: the study.
        module: has `show(console, found)`, `write_json(path, found)` and `plot(path, found)`.
    """
    check_distinct({name: subject, "--json": json, "--plot": plot})
    claim(json)
    claim_plot(plot)
    found = find()
    module.show(console, found)
    if json:
        module.write_json(json, found)
    if plot:
        module.plot(plot, found)


@contextmanager
def _compiling(scene: "Scene", progress: "Progress", task: "TaskID") -> Iterator[None]:
    """Say with a guess of the time when the scene's closed loop has to be compiled first, and only then."""
    from lapwing.runs.compile_notice import told
    from lapwing.services.scene_resolver import resolve

    def say(what: "Compilation") -> None:
        progress.update(task, description=f"compiling, about {what.seconds:.0f} s, then flying")

    with told(resolve(scene), say, alone=False):
        yield


@app.command()
def performance(
    subject: Annotated[Path, typer.Argument(metavar="SCENE|VEHICLE", help="a scene, or an airframe's TOML file")],
    json: Annotated[Path | None, typer.Option(metavar="FILE", help="write the figures as JSON")] = None,
) -> None:
    """Hover time, payload, range, ceiling, tilt and speed from the models, beside published figures."""
    from lapwing.studies import performance_card as study
    from lapwing.studies.terminal import console

    with user_errors():
        _study("SCENE|VEHICLE", subject, json, None, console(), lambda: study.card(subject), study)


@app.command()
def effects(
    scene: SceneFile,
    set_: Overrides = None,
    within: Annotated[float, typer.Option(metavar="M", help="how far the trajectory may change")] = 0.01,
    json: Annotated[Path | None, typer.Option(metavar="FILE", help="write the study as JSON")] = None,
    plot: Annotated[Path | None, typer.Option(metavar="FILE", help="draw it (PNG, SVG or PDF)")] = None,
) -> None:
    """What each effect of a scene costs and changes, and which of them it could do without."""
    from lapwing.cli.study_progress import Countdown
    from lapwing.services.scene_resolver import load
    from lapwing.studies.effects import console_output
    from lapwing.studies.effects.procedure import Study, study
    from lapwing.studies.terminal import console

    with user_errors():
        if not within > 0.0:
            raise ValueError(f"--within {within:g}: expected a distance above 0 m")
        screen = console()

        def find() -> Study:
            with Countdown(screen) as countdown:
                return study(load(scene, set_ or []), within, countdown.say)

        _study("SCENE", scene, json, plot, screen, find, console_output)


@app.command()
def accuracy(
    target: Annotated[str, typer.Argument(metavar="TARGET", help="a system of the study, or a scene (name or file)")],
    set_: Overrides = None,
    goal: Annotated[
        float | None, typer.Option("--target", metavar="ERROR", help="name the cheapest choice that meets it: 1e-6")
    ] = None,
    json: Annotated[Path | None, typer.Option(metavar="FILE", help="write all points as JSON")] = None,
    plot: Annotated[Path | None, typer.Option(metavar="FILE", help="draw error over time (PNG, SVG or PDF)")] = None,
) -> None:
    """Error against wall time of every integrator, on a system whose answer is known, or on a scene's plant."""
    with user_errors():
        from lapwing.studies.accuracy import accuracy_command

        console = accuracy_command.console()
        find = partial(accuracy_command.study, console, target, set_ or [], goal)
        _study("TARGET", Path(target), json, plot, console, find, accuracy_command)


@app.command()
def stability(
    case: Annotated[str | None, typer.Argument(metavar="CASE", help="one case; all without")] = None,
    long: Annotated[bool, typer.Option("--long", help="with the cases that take minutes")] = False,
    sweep: Annotated[
        bool, typer.Option("--sweep", help="walk each case's difficulty until every method breaks")
    ] = False,
    json: Annotated[Path | None, typer.Option(metavar="FILE", help="write all figures as JSON")] = None,
    report: Annotated[Path | None, typer.Option(metavar="FILE", help="write figures and plots (HTML)")] = None,
) -> None:
    """Hard cases beside a naive method that fails each: bounds, figures, verdicts. Exit code 1 if one falls short."""
    with user_errors():
        from lapwing.studies.stability import stability_command

        check_distinct({"--json": json, "--report": report})
        if report and report.suffix != ".html":
            raise ValueError(f"--report {report}: expected a name that ends in .html")
        claim(json)
        claim(report)
        stands = stability_command.run(case, long, sweep, json, report)
    if not stands:
        raise SystemExit(1)


@app.command()
def tune(
    scene: SceneFile,
    set_: Overrides = None,
    altitude: Annotated[
        float, typer.Option(metavar="RAD/S", help="bandwidth of the altitude loop")
    ] = Bandwidths().altitude,
    yaw: Annotated[float, typer.Option(metavar="RAD/S", help="bandwidth of the yaw loop")] = Bandwidths().yaw,
    attitude: Annotated[
        float, typer.Option(metavar="RAD/S", help="bandwidth of the inner roll and pitch loops")
    ] = Bandwidths().attitude,
    position: Annotated[
        float, typer.Option(metavar="RAD/S", help="bandwidth of the outer loops")
    ] = Bandwidths().position,
    log: Annotated[
        Path | None, typer.Option("--from", metavar="LOG", help="identify the plant from this flight (MCAP)")
    ] = None,
    out: Annotated[
        Path | None, typer.Option(metavar="FILE", help="write the gain set (TOML), for a scene to name")
    ] = None,
    report: Annotated[
        Path | None, typer.Option(metavar="FILE", help="write Bode plots, steps and tables (HTML)")
    ] = None,
) -> None:
    """Design gains about hover for bandwidth, 45 degrees and 6 dB in every loop, then polish them in flight."""
    from rich.progress import Progress

    from lapwing.services.scene_resolver import load
    from lapwing.studies.terminal import console
    from lapwing.studies.tune import console_output, gain_refinement, procedure
    from lapwing.studies.tune import tuning_report as page

    with user_errors():
        check_distinct({"SCENE": scene, "--from": log, "--out": out, "--report": report})
        for option, path, ending in (("--out", out, ".toml"), ("--report", report, ".html")):
            if path and path.suffix != ending:
                raise ValueError(f"{option} {path}: expected a name that ends in {ending}")
            claim(path)
        wanted, screen = Bandwidths(altitude, yaw, attitude, position), console()
        with Progress(console=screen, transient=True) as progress:
            task = progress.add_task("linearising, then flying gain sets", total=gain_refinement.CANDIDATES)
            loaded = load(scene, set_ or [])

            def say(text: str) -> None:
                progress.console.print(text, highlight=False, soft_wrap=True)

            with _compiling(loaded, progress, task):
                found = procedure.tune(
                    loaded, wanted, say, log, lambda: progress.update(task, advance=1, description="flying gain sets")
                )
        console_output.show(screen, found)
        if out:
            procedure.write(out, found.gains)
            typer.echo(f'{out}: a scene beside it names it with [autopilot] gains = "{out.name}"')
        if report:
            page.write(report, found)
            typer.echo(f"{report}: Bode plots, margins and steps")
