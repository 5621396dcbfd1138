"""`lapwing test`: flights of a folder of scenes against their own criteria, for continuous integration."""

import time
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated
from xml.etree import ElementTree

import typer

from lapwing.cli.app import app
from lapwing.cli.error_exit import FLIGHT_FAILED
from lapwing.cli.output_paths import claim
from lapwing.cli.scene_commands import scenes_of

PASSED, FAILED, BROKEN = "passed", "failure", "error"  # the last two are those of JUnit


@app.command("test")
def scene_tests(
    folder: Annotated[Path, typer.Argument(metavar="FOLDER", help="folder of scenes (TOML), or one scene")],
    junit: Annotated[
        Path | None, typer.Option("--junit", metavar="FILE", help="write the results as JUnit XML")
    ] = None,
    keep: Annotated[
        Path, typer.Option("--keep", metavar="FOLDER", help="folder for log and report of each failed flight")
    ] = Path("failed"),
) -> None:
    """Fly the scenes of a folder and check the success of each.

    A scene fails if its vehicle does not meet success.require. It is an error if the scene is invalid, or the
    simulation ends early.

    Exit codes: 1 a simulation failed, 2 invalid input, 4 a vehicle failed.
    """
    from lapwing.views.terminal import counted

    claim(junit)
    scenes = scenes_of(folder)
    suite = ElementTree.Element("testsuite", name=folder.name or str(folder.resolve().name))
    kinds = []
    for path in scenes:
        case = ElementTree.SubElement(suite, "testcase", classname=str(path.parent), name=path.stem)
        with _timed(case):
            kind, message = _result(path, keep)
        kinds.append(kind)
        if kind != PASSED:
            ElementTree.SubElement(case, kind, message=message).text = message
        word = {PASSED: "passed", FAILED: "FAILED", BROKEN: "ERROR"}[kind]
        typer.echo(f"{word}  {path.stem}  {float(case.get('time', 0)):.1f} s" + (f"  {message}" if message else ""))
    failures, errors = kinds.count(FAILED), kinds.count(BROKEN)
    suite.attrib |= {"tests": str(len(kinds)), "failures": str(failures), "errors": str(errors)}
    if junit:
        ElementTree.ElementTree(suite).write(junit, encoding="utf-8", xml_declaration=True)
    typer.echo(f"{len(kinds) - failures - errors} passed, {failures} failed, {counted(errors, 'error')}")
    if errors or failures:
        raise SystemExit(1 if errors else FLIGHT_FAILED)


@contextmanager
def _timed(case: ElementTree.Element) -> Iterator[None]:
    start = time.perf_counter()
    yield
    case.set("time", f"{time.perf_counter() - start:.3f}")


def _result(path: Path, keep: Path) -> tuple[str, str]:
    """Fly a scene. Return the kind of its result, and the reason."""
    from lapwing.api.functions import fly, load_scene
    from lapwing.flights.metrics import metrics
    from lapwing.services.common.schemas.success_criteria import Success
    from lapwing.views.report.write import unavailable

    try:
        scene = load_scene(path)
        with warnings.catch_warnings(record=True) as caught:
            flight = fly(scene)
        for each in caught:
            typer.echo(f"lapwing: warning: {path.stem}: {each.message}", err=True)
        shortfall = "" if flight.failure else scene[Success].shortfall(metrics(flight))
    except ValueError as error:
        return BROKEN, str(error)
    if not (flight.failure or shortfall):
        return PASSED, ""
    keep.mkdir(parents=True, exist_ok=True)
    log = flight.save(keep / f"{path.stem}.mcap")
    if not unavailable():
        flight.report(log.with_suffix(".html"), view3d=False)
    if flight.failure:
        return BROKEN, f"the simulation ended early: {flight.failure} ({log})"
    return FAILED, f"{flight.outcome.kind}; success.require: {shortfall} ({log})"
