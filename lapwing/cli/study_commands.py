"""Studies: performance, effects, accuracy, stability, tune."""

from collections.abc import Callable
from itertools import count
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Annotated, Any

import typer

from lapwing.cli.app import app
from lapwing.cli.error_exit import fail
from lapwing.cli.options import Overrides, SceneFile
from lapwing.cli.output_paths import check_distinct, claim, claim_named, claim_plot
from lapwing.cli.preflight import with_solver_selected
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
    if json:
        module.write_json(json, result)
    if plot:
        module.plot(plot, result)
    module.show(console, result)  # last: a closed pipe, as of `head`, ends the command


@app.command()
def performance(
    subject: Annotated[Path, typer.Argument(metavar="SCENE|VEHICLE", help="scene, or airframe file (TOML)")],
    json: Annotated[Path | None, typer.Option(metavar="FILE", help="write the result as JSON")] = None,
) -> None:
    """Compute hover time, range, payload, ceiling and top speed.

    Published values are shown next to the computed ones.
    """
    from lapwing.studies.performance import card
    from lapwing.views.studies import study_result
    from lapwing.views.studies.performance_result import result
    from lapwing.views.terminal import console

    _study("SCENE|VEHICLE", subject, json, None, console(), lambda: result(subject, card(subject)), study_result)


@app.command()
def effects(
    scene: Annotated[
        Path | None, typer.Argument(metavar="SCENE", help="scene file (TOML), or name of a shipped scene")
    ] = None,
    set_: Overrides = None,
    listed: Annotated[bool, typer.Option("--list", help="list all effects with cost and keys instead")] = False,
    tolerance: Annotated[float, typer.Option(metavar="M", help="largest permitted change of the trajectory")] = 0.01,
    only: Annotated[
        str | None, typer.Option(metavar="NAME,...", help="effects to study; all without this option")
    ] = None,
    json: Annotated[Path | None, typer.Option(metavar="FILE", help="write the result as JSON")] = None,
    plot: Annotated[Path | None, typer.Option(metavar="FILE", help="write a plot (PNG, SVG or PDF)")] = None,
) -> None:
    """Measure the cost and influence of each effect of a scene.

    Lists the effects that could be omitted within --tolerance. In a scene of several vehicles each effect is removed
    from all of them, or added to all; path and end are the largest changes, energy and cost are those of all vehicles.
    """
    from lapwing.cli.progress import StudyProgress
    from lapwing.studies.effects.procedure import study
    from lapwing.views.studies import effects_result
    from lapwing.views.studies.study_result import show, write_json, write_plot
    from lapwing.views.terminal import console

    names = None if only is None else [name.strip() for name in only.split(",")]
    if names is not None and not all(names):
        raise ValueError(f"--only {only!r}: expected names of effects, separated by commas")
    if listed:
        from lapwing.file_schemas.descriptions import effects_list

        for line in effects_list(names):
            typer.echo(line)
        return
    if scene is None:
        raise ValueError("SCENE: missing; expected a scene, or --list (see lapwing effects --help)")
    check_distinct({"SCENE": scene, "--json": json, "--plot": plot})
    claim(json)
    claim_plot(plot)
    if not tolerance > 0.0:
        raise ValueError(f"--tolerance {tolerance:g}: expected a distance above 0 m")
    screen = console()

    with StudyProgress(screen, "parts") as progress:
        result = effects_result.result(study(with_solver_selected(scene, set_ or []), tolerance, progress.say, names))
    if json:
        write_json(json, result)
    if plot:
        write_plot(plot, result)
    show(screen, result)


@app.command()
def accuracy(
    target: Annotated[str, typer.Argument(metavar="TARGET", help="reference problem, or scene (name or file)")],
    set_: Overrides = None,
    goal: Annotated[
        float | None,
        typer.Option("--target", metavar="ERROR", help="error to meet [default: solver.accuracy of a scene, or 1e-6]"),
    ] = None,
    json: Annotated[Path | None, typer.Option(metavar="FILE", help="write all results as JSON")] = None,
    plot: Annotated[
        Path | None, typer.Option(metavar="FILE", help="plot error over CPU time (PNG, SVG or PDF)")
    ] = None,
) -> None:
    """Measure error against CPU time of every integrator.

    The first line is the one that meets the target with the fewest evaluations. The subject is a reference problem with
    a known solution, or a scene: the table has its plant in the air, the first line what its flight needs.
    """
    from lapwing.cli.progress import step_progress
    from lapwing.views.studies import accuracy_command
    from lapwing.views.terminal import console

    screen = console(piped=120)

    def find() -> accuracy_command.Study:
        with step_progress(screen, "parts", 1, announced=True) as progress:
            return accuracy_command.study(target, set_ or [], goal, progress)

    _study("TARGET", Path(target), json, plot, screen, find, accuracy_command)


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
    from lapwing.cli.progress import StudyProgress
    from lapwing.cosim.processes.interrupt import Interrupted
    from lapwing.studies.stability.case_runner import Result, measure, select
    from lapwing.views.studies import stability_result
    from lapwing.views.studies.study_result import show, write_json, write_report
    from lapwing.views.terminal import console

    check_distinct({"--json": json, "--report": report})
    claim(json)
    claim_named("--report", report, ".html")
    screen, names, results = console(piped=180), select(case, slow, sweep), list[Result]()
    with StudyProgress(screen, "cases") as progress:
        try:
            for result in measure(names, sweep):
                results.append(result)
                progress.say(result.case, len(results), len(names))
        except Interrupted as interrupted:
            finished = f"{len(results)} of {len(names)} cases finished: {', '.join(each.case for each in results)}"
            detail = f"{finished}; {stability_result.result(results).verdict}" if results else ""
            raise Interrupted(interrupted.signal, detail) from None
    page = stability_result.result(sorted(results, key=lambda each: names.index(each.case)))
    if json:
        write_json(json, page)
    if report:
        write_report(report, page)
    show(screen, page)
    if page.mark == "bad":
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
    from lapwing.runs.observer import notify_on_compile
    from lapwing.services.scene_resolver import resolve
    from lapwing.studies.tune import gain_refinement, procedure
    from lapwing.views.studies import tune_result
    from lapwing.views.studies.study_result import show as show_result
    from lapwing.views.studies.study_result import write_report
    from lapwing.views.terminal import console

    check_distinct({"SCENE": scene, "--from": log, "--out": out, "--report": report})
    claim_named("--out", out, ".toml")
    claim_named("--report", report, ".html")
    target, screen = Bandwidths(altitude, yaw, attitude, position), console()
    loaded, numbers = with_solver_selected(scene, set_ or []), count(1)
    with step_progress(screen, "gain sets at most") as progress:

        def show(text: str, done: int = 0) -> None:
            progress(text, done, gain_refinement.GAIN_SETS)

        with notify_on_compile(resolve(loaded), lambda _: show("compiling, then flying")):
            result = procedure.tune(
                loaded,
                target,
                lambda text: screen.print(text, soft_wrap=True),
                log,
                lambda: show("flying gain sets", next(numbers)),
            )
    page = tune_result.result(result)
    lines = []
    if out and (force or not result.failures):
        procedure.write(out, result.gains)
        lines.append(f'{out}: use it with [autopilot] gains = "{out.name}"')
    if report:
        write_report(report, page)
        lines.append(f"{report}: Bode plots, margins and steps")
    show_result(screen, page)
    for line in lines:
        typer.echo(line)
    if out and result.failures and not force:
        fail(f"{out}: not written, the gains fail {'; '.join(result.failures)}; use --force to write them", 1)
