"""Studies: performance, effects, accuracy, stability, tune."""

from collections.abc import Callable
from functools import partial
from itertools import count
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Annotated, Any

import typer

from lapwing.cli.app import app
from lapwing.cli.error_exit import fail
from lapwing.cli.options import Overrides, SceneFile
from lapwing.cli.output_paths import check_distinct, claim, claim_named, claim_plot
from lapwing.studies.tune.bandwidths import Bandwidths

if TYPE_CHECKING:
    from rich.console import Console


def _study(
    name: str,
    subject: Path,
    json: Path | None,
    plot: Path | None,
    console: "Console",
    find: Callable[[], Any],
    module: ModuleType,
) -> None:
    """Check the output files, run a study, and print and write its result.

    Args:
        name: argument that names the subject, for messages.
        subject: value of that argument.
        json: file for the result.
        plot: file for the plot.
        console: output.
        find: runs the study.
        module: has `show(console, result)`, `write_json(path, result)` and `plot(path, result)`.
    """
    check_distinct({name: subject, "--json": json, "--plot": plot})
    claim(json)
    claim_plot(plot)
    result = find()
    module.show(console, result)
    if json:
        module.write_json(json, result)
    if plot:
        module.plot(plot, result)


@app.command()
def performance(
    subject: Annotated[Path, typer.Argument(metavar="SCENE|VEHICLE", help="scene, or airframe file (TOML)")],
    json: Annotated[Path | None, typer.Option(metavar="FILE", help="write the result as JSON")] = None,
) -> None:
    """Compute hover time, range, payload, ceiling and top speed.

    Published values are shown next to the computed ones.
    """
    from lapwing.studies import performance_card as study
    from lapwing.studies.terminal import console

    _study("SCENE|VEHICLE", subject, json, None, console(), lambda: study.card(subject), study)


@app.command()
def effects(
    scene: SceneFile,
    set_: Overrides = None,
    tolerance: Annotated[float, typer.Option(metavar="M", help="largest permitted change of the trajectory")] = 0.01,
    only: Annotated[
        str | None,
        typer.Option(metavar="NAME,...", help="effects to study; all without this option"),
    ] = None,
    json: Annotated[Path | None, typer.Option(metavar="FILE", help="write the result as JSON")] = None,
    plot: Annotated[Path | None, typer.Option(metavar="FILE", help="write a plot (PNG, SVG or PDF)")] = None,
) -> None:
    """Measure the cost and influence of each effect of a scene.

    Lists the effects that could be omitted within --tolerance. In a scene of several vehicles each effect is removed
    from all of them, or added to all; path and end are the largest changes, energy and cost are those of all vehicles.
    """
    from lapwing.cli.progress import StudyProgress
    from lapwing.services.scene_resolver import load
    from lapwing.studies.effects import console_output
    from lapwing.studies.effects.procedure import Study, study
    from lapwing.studies.terminal import console

    if not tolerance > 0.0:
        raise ValueError(f"--tolerance {tolerance:g}: expected a distance above 0 m")
    screen = console()
    names = None if only is None else [name.strip() for name in only.split(",")]
    if names is not None and not all(names):
        raise ValueError(f"--only {only!r}: expected names of effects, separated by commas")

    def find() -> Study:
        with StudyProgress(screen, "flights") as progress:
            return study(load(scene, set_ or []), tolerance, progress.say, names)

    _study("SCENE", scene, json, plot, screen, find, console_output)


@app.command()
def accuracy(
    target: Annotated[str, typer.Argument(metavar="TARGET", help="reference problem, or scene (name or file)")],
    set_: Overrides = None,
    goal: Annotated[
        float | None,
        typer.Option("--target", metavar="ERROR", help="find the cheapest solver with at most this error, e.g. 1e-6"),
    ] = None,
    json: Annotated[Path | None, typer.Option(metavar="FILE", help="write all results as JSON")] = None,
    plot: Annotated[
        Path | None, typer.Option(metavar="FILE", help="plot error over wall time (PNG, SVG or PDF)")
    ] = None,
) -> None:
    """Measure error against wall time of every integrator.

    The subject is a reference problem with a known solution, or the plant of a scene.
    """
    from lapwing.studies.accuracy import accuracy_command

    console = accuracy_command.console()
    find = partial(accuracy_command.study, console, target, set_ or [], goal)
    _study("TARGET", Path(target), json, plot, console, find, accuracy_command)


@app.command()
def stability(
    case: Annotated[str | None, typer.Argument(metavar="CASE", help="case to run [all]")] = None,
    slow: Annotated[bool, typer.Option("--slow", help="include cases that take minutes")] = False,
    sweep: Annotated[
        bool, typer.Option("--sweep", help="increase the difficulty of each case until every method fails")
    ] = False,
    json: Annotated[Path | None, typer.Option(metavar="FILE", help="write all results as JSON")] = None,
    report: Annotated[Path | None, typer.Option(metavar="FILE", help="write results and plots (HTML)")] = None,
) -> None:
    """Run numerically hard cases against their error bounds.

    Each case is also run with a baseline method that fails it.

    Exit codes: 1 a case misses its bound, 2 invalid input.
    """
    from lapwing.studies.stability import stability_command

    check_distinct({"--json": json, "--report": report})
    claim(json)
    claim_named("--report", report, ".html")
    passed = stability_command.run(case, slow, sweep, json, report)
    if not passed:
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
        Path | None, typer.Option("--from", metavar="LOG", help="identify the plant from this MCAP log")
    ] = None,
    out: Annotated[
        Path | None, typer.Option(metavar="FILE", help="write the gain set (TOML) for use in a scene")
    ] = None,
    report: Annotated[
        Path | None, typer.Option(metavar="FILE", help="write Bode plots, step responses and tables (HTML)")
    ] = None,
    force: Annotated[
        bool, typer.Option("--force", help="write the gains even if they fail a flight of a perturbed vehicle")
    ] = False,
) -> None:
    """Design controller gains and refine them in simulated flight.

    Each loop gets the given bandwidth, with margins of 45 degrees and 6 dB at hover.
    """
    from lapwing.cli.progress import step_progress
    from lapwing.runs.compile_notice import notify_on_compile
    from lapwing.services.scene_resolver import load, resolve
    from lapwing.studies.terminal import console
    from lapwing.studies.tune import console_output, gain_refinement, procedure
    from lapwing.studies.tune import tuning_report as page

    check_distinct({"SCENE": scene, "--from": log, "--out": out, "--report": report})
    claim_named("--out", out, ".toml")
    claim_named("--report", report, ".html")
    target, screen = Bandwidths(altitude, yaw, attitude, position), console()
    loaded, numbers = load(scene, set_ or []), count(1)
    with step_progress(screen, "gain sets at most") as progress:

        def show(text: str, done: int = 0) -> None:
            progress(text, done, gain_refinement.CANDIDATES)

        show("linearising")
        with notify_on_compile(resolve(loaded), lambda _: show("compiling, then flying")):
            result = procedure.tune(
                loaded,
                target,
                lambda text: screen.print(text, soft_wrap=True),
                log,
                lambda: show("flying gain sets", next(numbers)),
            )
    console_output.show(screen, result)
    if out and (force or not result.failures):
        procedure.write(out, result.gains)
        typer.echo(f'{out}: use it with [autopilot] gains = "{out.name}"')
    if report:
        page.write(report, result)
        typer.echo(f"{report}: Bode plots, margins and steps")
    if out and result.failures and not force:
        fail(f"{out}: not written, the gains fail {'; '.join(result.failures)}; use --force to write them", 1)
