"""Campaigns: many runs of a scene, and the comparison of two campaigns."""

from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from lapwing.cli.app import app
from lapwing.cli.options import Overrides, SceneFile
from lapwing.cli.output_paths import check_distinct, check_not_dash, claim, claim_folder, claim_report
from lapwing.cli.preflight import check_firmware_program, print_warnings, with_solver_selected
from lapwing.cosim.optional_packages import missing

if TYPE_CHECKING:
    from rich.console import Console

    from lapwing.studies.campaign.distributions import Distribution
    from lapwing.studies.campaign.folder import Folder
    from lapwing.studies.campaign.plan import Plan
    from lapwing.studies.campaign.runs import Reference
    from lapwing.studies.workers import Workers

LINES = 5.0  # [s] between progress lines without a terminal


@app.command()
def campaign(
    scene: SceneFile,
    set_: Overrides = None,
    runs: Annotated[
        int | None, typer.Option(metavar="N", help="number of runs [100, or the size of the sweep or grid]")
    ] = None,
    seed: Annotated[int, typer.Option(metavar="S", help="seed of the campaign, from which all runs draw")] = 1,
    vary: Annotated[
        list[str] | None,
        typer.Option(
            metavar="KEY=DISTRIBUTION|FILE.toml",
            help="random scene key: vehicle.mass=normal(10.4,0.2), autopilot.gains=choice(a.toml,b.toml); or all "
            "parameters of a file of `lapwing identify`, with their correlations (repeatable)",
        ),
    ] = None,
    sweep: Annotated[
        Path | None,
        typer.Option(metavar="FILE.csv", help="table of scene keys: a column for each key, a row for each run"),
    ] = None,
    design: Annotated[
        str, typer.Option(metavar="random|lhs|sobol|grid", help="sampling of the random keys")
    ] = "random",
    out: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="campaign folder; repeating the command resumes it [campaigns/...]"),
    ] = None,
    csv: Annotated[bool, typer.Option("--csv", help="also write the table of runs as CSV")] = False,
    json: Annotated[Path | None, typer.Option(metavar="FILE", help="write the results as JSON")] = None,
    report: Annotated[Path | None, typer.Option(metavar="FILE.html|pdf|png", help="report [DIR/report.html]")] = None,
    ci_half_width: Annotated[
        float | None,
        typer.Option("--ci-half-width", metavar="P", help="stop once the failure probability is known to +-P (95 %)"),
    ] = None,
    workers: Annotated[int | None, typer.Option(metavar="N", help="number of processes [one for each core]")] = None,
    cluster: Annotated[
        str | None, typer.Option(metavar="ADDRESS", help="run on a Dask cluster, e.g. tcp://scheduler:8786")
    ] = None,
    shard: Annotated[
        str | None, typer.Option(metavar="I/N", help="run part I of N only, for arrays of batch jobs")
    ] = None,
    explain: Annotated[
        int | None,
        typer.Option(metavar="RUN", help="SCENE is a campaign folder: find the least change with which its run fails"),
    ] = None,
    allow_code: Annotated[bool, typer.Option("--allow-code", help="allow FMUs of the scene to run")] = False,
) -> None:
    """Fly a scene many times with random parameters.

    Reports how many runs fail and why, the failure probability, error distributions, and which parameters matter.
    """
    from lapwing.services.common import foreign_code

    with foreign_code.permission(allow_code), ExitStack() as stack:
        if explain is not None:
            _explain(scene, explain, json)
            return
        if workers is not None and workers < 1:
            raise ValueError(f"--workers {workers}: expected at least 1")
        if ci_half_width is not None and not 0.0 < ci_half_width < 0.5:
            raise ValueError(
                f"--ci-half-width {ci_half_width:g}: expected a probability above 0 and below 0.5, for example 0.01"
            )
        if ci_half_width is not None and shard is not None:
            raise ValueError("--ci-half-width: needs the results of all runs; leave out --shard")
        if cluster is not None and workers is not None:
            raise ValueError("--workers: a cluster has its own workers; leave out --cluster")
        check_distinct({"SCENE": scene, "--sweep": sweep, "--json": json, "--report": report})
        check_not_dash(out)
        claim(json)
        claim_report("--report", report)
        selected_part = _parse_shard(shard)

        from lapwing.studies.campaign.plan import SEED, plan  # imports scipy

        if any(text.partition("=")[0].strip() == SEED for text in set_ or []):
            raise ValueError(f"--set {SEED}: each run has its own seed, by the seed of the campaign; use --seed")
        distributions = _distributions(vary or [])
        try:
            campaign_plan = plan(str(scene), set_ or [], runs, seed, distributions, sweep, design)
        except ValueError as error:  # begins with the argument, which the option has as its name
            raise ValueError(f"--{error}") from None
        selected = with_solver_selected(scene, set_ or [])
        check_firmware_program(selected)
        campaign_plan = campaign_plan._replace(overrides=tuple(selected.overrides))

        from lapwing.cosim.processes.watchdog import Watchdog
        from lapwing.services.scene_resolver import resolve
        from lapwing.studies.campaign.folder import begin, default_path, manifest
        from lapwing.studies.workers import cores
        from lapwing.views.terminal import console

        print_warnings(selected, resolve(selected))
        stack.enter_context(Watchdog())
        screen = console()
        first = _reference(screen, campaign_plan)
        campaign_manifest = manifest(campaign_plan, first)
        folder = begin(out or default_path(campaign_manifest), campaign_plan, campaign_manifest)
        claim_folder(folder.path, shared=shard is not None)
        part = _shards_of(selected_part, len(folder.shards))
        number = 0 if cluster else min(workers or cores(), len(folder.missing()))
        _fly(screen, folder, first, _workers(screen, cluster, number), number, ci_half_width, part)
        if shard is not None and folder.missing():
            screen.print(f"{folder.path}: part {shard} complete, {len(folder.missing())} shards missing")
            return
        digest = folder.finish(csv)

        from lapwing.file_schemas.json_schema import key_units
        from lapwing.studies.campaign.results import Results
        from lapwing.views.studies.campaign_result import result
        from lapwing.views.studies.study_result import show, write_json, write_report

        results = Results(folder, key_units(campaign_plan.keys))
        found = result(results, digest)
        if json:
            write_json(json, found)
        page, lacking = report or folder.path / "report.html", missing("jinja2", "plotly", "matplotlib")
        if len(results) and not lacking:
            write_report(page, found)
        show(screen, found)  # after the files: a closed pipe, as of `head`, ends the command
        if len(results):
            screen.print(f"report  {f'none: {lacking}' if lacking else page}", soft_wrap=True)
        screen.print(f"{'digest':<7} {digest}\n{'folder':<7} {folder.path}", soft_wrap=True)


@app.command()
def compare(
    one: Annotated[Path, typer.Argument(metavar="DIR", help="folder of a campaign")],
    other: Annotated[Path, typer.Argument(metavar="DIR", help="folder of a second campaign with the same seed")],
    json: Annotated[Path | None, typer.Option(metavar="FILE", help="write the differences as JSON")] = None,
) -> None:
    """Compare two campaigns run by run, with confidence intervals."""
    from lapwing.studies.campaign.comparison import compare as study
    from lapwing.views.studies.campaign_result import comparison_result
    from lapwing.views.studies.study_result import show, write_json
    from lapwing.views.terminal import console

    claim(json)
    result = comparison_result(study(one, other))
    if json:
        write_json(json, result)
    show(console(), result)


def _explain(folder: Path, run: int, json: Path | None) -> None:
    """Print the least change of the varied parameters with which a run of a campaign still fails."""
    from lapwing.cli.progress import step_progress
    from lapwing.studies.campaign.explanation import explain
    from lapwing.views.studies.campaign_result import explanation_result
    from lapwing.views.studies.study_result import show, write_json
    from lapwing.views.terminal import console

    screen = console()
    claim(json)
    with step_progress(screen, "flights", announced=True) as progress:
        result = explanation_result(explain(folder, run, progress))
    if json:
        write_json(json, result)
    show(screen, result)


def _reference(screen: "Console", campaign_plan: "Plan") -> "Reference":
    from lapwing.runs.observer import notify_on_compile
    from lapwing.studies.campaign.runs import first_config, reference

    run, config = first_config(campaign_plan)
    with notify_on_compile(config, lambda what: screen.print(what.notice, soft_wrap=True)):
        return reference(run, config)


def _distributions(vary: list[str]) -> "dict[str, Distribution]":
    """Return the distributions of texts KEY=DISTRIBUTION, or of files of estimated parameters, by key."""
    from lapwing.studies.campaign.distributions import parse  # imports scipy

    result: dict[str, Distribution] = {}
    for text in vary:
        if "=" not in text and text.endswith(".toml"):
            from lapwing.studies.campaign.posterior import posterior  # imports numba

            drawn = posterior(text)
            if twice := sorted(set(drawn) & set(result)):
                raise ValueError(f"--vary {text}: {twice[0]} already has a distribution; use one for each key")
            result |= drawn
            continue
        key, separator, distribution = (part.strip() for part in text.partition("="))
        if not separator or not key:
            raise ValueError(f"--vary {text}: expected KEY=DISTRIBUTION, for example vehicle.mass=normal(10.4,0.2)")
        if key in result:
            raise ValueError(f"--vary {text}: {key} already has a distribution; use one for each key")
        try:
            result[key] = parse(distribution)
        except ValueError as error:
            raise ValueError(f"--vary {text}: {error}") from None
    return result


def _parse_shard(text: str | None) -> tuple[int, int] | None:
    """Return (I, N) of --shard I/N; None without --shard."""
    if text is None:
        return None
    i, _, n = text.partition("/")
    if not (i.isdecimal() and n.isdecimal() and 1 <= int(i) <= int(n)):
        raise ValueError(f"--shard {text}: expected I/N with I from 1 to N, for example 3/8")
    return int(i), int(n)


def _shards_of(part: tuple[int, int] | None, shards: int) -> range | None:
    """Return the shards of part I of N; None without --shard."""
    if part is None:
        return None
    i, n = part
    if n > shards:
        raise ValueError(f"--shard {i}/{n}: the campaign has {shards} shards; expected at most I/{shards}")
    return range(i - 1, shards, n)


def _workers(screen: "Console", cluster: str | None, number: int) -> "Workers":
    from lapwing.studies import workers

    if cluster is not None:
        from lapwing.studies.workers import dask

        return dask(cluster, lambda line: screen.print(line, soft_wrap=True))
    return workers.run_here if number <= 1 else workers.processes(number)


def _fly(
    screen: "Console",
    folder: "Folder",
    first: "Reference",
    workers: "Workers",
    parallel: int,
    until: float | None,
    part: range | None,
) -> None:
    import time

    from lapwing.cli.progress import StudyProgress
    from lapwing.cosim.processes.interrupt import Interrupted
    from lapwing.studies.campaign.shard_loop import Count
    from lapwing.studies.campaign.shard_loop import campaign as study
    from lapwing.studies.campaign.statistics import percent

    start, previous = time.monotonic(), -1
    runs = {k: len(shard) for k, shard in enumerate(folder.shards) if part is None or k in part}  # by own shard
    own_runs = sum(runs.values())
    before = own_runs - sum(runs.get(k, 0) for k in folder.missing())  # recorded earlier
    if before:
        screen.print(f"{folder.path}: {before} of {own_runs} runs were done before", soft_wrap=True)
    with StudyProgress(screen, "flights", parallel, LINES, until is not None, before) as progress:

        def say(count: Count) -> None:
            nonlocal previous
            previous = count.runs if previous < 0 else previous
            finished, rate = count.runs - previous, (count.runs - previous) / max(time.monotonic() - start, 1e-9)
            share = f", {percent(count.failure)}" if count.accepted else ""
            text = f"{rate:.1f} runs/s, {count.failures} failures{share}"
            progress.say(text, before + finished, own_runs)

        try:
            counted = study(folder, first, workers, say, until, part).runs
        except Interrupted as interrupted:
            kept = own_runs - sum(runs.get(k, 0) for k in folder.missing())
            detail = f"{kept} of {own_runs} runs are kept; run the same command again to continue" if kept else ""
            raise Interrupted(interrupted.signal, detail) from None
    if until is not None and counted < own_runs:
        screen.print(f"--ci-half-width {until:g} is reached after {counted} of {own_runs} runs")
