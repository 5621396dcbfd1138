"""Logs: summary, verification, recovery and export."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from lapwing.cli.app import app
from lapwing.cli.error_exit import DIFFERENT, fail
from lapwing.cli.options import LogFile
from lapwing.cli.output_paths import check_distinct, check_log, claim, claim_named, create_folder
from lapwing.cosim.output_lock import write_errors

if TYPE_CHECKING:
    from lapwing.flights.logs.log_comparison import Comparison
    from lapwing.flights.logs.log_info import Info


@app.command()
def info(log: LogFile) -> None:
    """Show the origin, topics, events and gaps of a log."""
    from lapwing.cli.run_summary import fleet, show_events
    from lapwing.flights.logs.log_info import info as look
    from lapwing.views.terminal import console

    result = look(log)
    for label, line in _about(result).items():
        typer.echo(f"  {label:<9} {line}")
    for line in _topics(result):
        typer.echo(line)
    flights = fleet(log)
    for flight in flights:
        if len(flights) > 1:
            typer.echo(f"{flight.vehicle}:")
        show_events(console(), [event._asdict() for event in flight.events])


@app.command()
def verify(
    log: LogFile,
    other: Annotated[
        Path | None, typer.Argument(metavar="[FILE]", help="second log, to compare with the first")
    ] = None,
    explain: Annotated[
        bool, typer.Option("--explain", help="also show what recorded the log, and whether its digest is expected here")
    ] = False,
) -> None:
    """Check the digest of a log, or find where two logs differ.

    Exit codes: 2 invalid input, 3 the digest or the logs differ.
    """
    from lapwing.cosim.log import LogReader

    if other is not None:
        if explain:
            raise ValueError("--explain: describes one log; leave out the second FILE")
        from lapwing.flights.logs.log_comparison import compare

        check_distinct({"FILE": log, "the second FILE": other})
        comparison = compare(log, other)
        for line in _differences(comparison):
            typer.echo(line)
        if not comparison.same:
            fail(f"{log} and {other} differ", DIFFERENT)
        typer.echo(f"{log} and {other}: identical messages")
        return
    with LogReader(log) as read:
        recorded, computed, metadata = read.metadata.get("digest"), read.digest(), read.metadata
    if explain:
        from lapwing.flights.logs.log_comparison import expectation, facts

        for fact in facts(metadata):
            note = "same" if fact.recorded == fact.here else f"here {fact.here}"
            typer.echo(f"  {fact.name:<10} {fact.recorded} ({note})")
        typer.echo(f"  {'expected':<10} {expectation(metadata)}")
    if recorded is None:
        raise ValueError(f"{log}: has no digest; expected a complete log (lapwing recover completes one)")
    if recorded != computed:
        fail(f"{log}: digests differ: recorded {recorded}, computed {computed}", DIFFERENT)
    typer.echo(f"{log}: digest {recorded} is correct")


@app.command()
def recover(
    log: LogFile,
    out: Annotated[Path | None, typer.Option(metavar="FILE", help="recovered log [FILE_recovered.mcap]")] = None,
) -> None:
    """Write the intact messages of a damaged log to a new log."""
    from lapwing.cosim.log.log_editing import recover as save

    target = out or log.with_name(f"{log.stem}_recovered.mcap")
    check_distinct({"FILE": log, "--out": target})
    check_log(target)
    result = save(log, target)
    for line in result.damaged:
        typer.echo(f"left out: {line}")
    typer.echo(f"{target}: {result.messages} messages up to t = {result.end_ns * 1e-9:g} s, digest {result.digest}")


@app.command()
def export(
    log: LogFile,
    parquet: Annotated[
        Path | None, typer.Option(metavar="FOLDER", help="write an Apache Parquet file for each topic")
    ] = None,
    csv: Annotated[Path | None, typer.Option(metavar="FOLDER", help="write a CSV file for each topic")] = None,
    mat: Annotated[
        Path | None, typer.Option(metavar="FILE", help="write a MATLAB file with a struct for each topic")
    ] = None,
    ulog: Annotated[
        Path | None, typer.Option(metavar="FILE", help="write motion, motors, battery and setpoints as a log of PX4")
    ] = None,
    topics: Annotated[str | None, typer.Option(metavar="TOPIC,...", help="export only these topics as tables")] = None,
) -> None:
    """Write a log as CSV, Parquet or MATLAB tables, or as a ULog file."""
    from lapwing.cosim.log import LogReader
    from lapwing.flights.logs import log_export as tables

    if not (parquet or csv or mat or ulog):
        raise ValueError("export: expected --parquet FOLDER, --csv FOLDER, --mat FILE or --ulog FILE")
    check_distinct({"FILE": log, "--parquet": parquet, "--csv": csv, "--mat": mat, "--ulog": ulog})
    claim(mat)
    claim_named("--ulog", ulog, ".ulg")
    if ulog:
        from lapwing.flights.logs.ulog_export import write_ulog

        with write_errors(ulog):
            write_ulog(log, ulog)
        typer.echo(ulog)
    if not (parquet or csv or mat):
        return
    with LogReader(log) as read:
        result = tables.tables(read, topics.split(",") if topics is not None else None)
        if not read.complete:
            typer.echo(f"{log}: the log is incomplete: its end is missing, see lapwing info", err=True)
    for target, write in ((parquet, tables.write_parquet), (csv, tables.write_csv), (mat, tables.write_mat)):
        if target is None:
            continue
        if target is not mat:
            create_folder(target)
        with write_errors(target):
            for path in write(result, target):
                typer.echo(path)


def _about(info: "Info") -> dict[str, str]:
    """Return the header lines of `info` by label."""
    from lapwing.flights.flight_provenance import solver_and_exchange

    metadata = info.metadata
    count = sum(topic.messages for topic in info.topics)
    lines = {
        "scene": metadata.get("scene", ""),
        "vehicle": metadata.get("vehicle", ""),
        "seed": metadata.get("seed", ""),
        "mode": metadata.get("mode", ""),
        "version": " ".join(filter(None, (metadata.get("version", ""), metadata.get("commit", "")))),
        **solver_and_exchange(metadata),
        "duration": f"{info.end - info.start:g} s, from {info.start:g} to {info.end:g} s",
        "size": f"{info.size / 1e6:.2f} MB, {count} messages",
        "files": ", ".join(info.files),
        "digest": metadata.get("digest", ""),
        "failure": metadata.get("failure", ""),
        "waited": f"{metadata['waited_for_disk']} for the disk" if "waited_for_disk" in metadata else "",
        "recovered": metadata.get("recovered", ""),
        "end": "" if info.complete else "none, the recorder was ended; use lapwing recover",
    }
    lines |= {command: f"not possible: the log lacks {needed}" for command, needed in info.missing.items()}
    return {label: line for label, line in lines.items() if line}


def _topics(info: "Info") -> list[str]:
    """Return the topic table of `info` as lines."""
    rows = [("topic", "messages", "rate [Hz]", "kB", "type", "gaps")]
    for topic in info.topics:
        rate = f"{topic.rate:g}" if topic.rate else ""
        gaps = f"{topic.gaps}, longest {topic.longest:g} s" if topic.gaps else ""
        rows.append((topic.name, str(topic.messages), rate, f"{topic.size / 1000:.1f}", topic.kind, gaps))
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    left_aligned = (True, False, False, False, True, True)
    return [
        "  ".join(
            f"{cell:{'<' if is_left else '>'}{width}}"
            for cell, is_left, width in zip(row, left_aligned, widths, strict=True)
        )
        for row in rows
    ]


def _differences(comparison: "Comparison") -> list[str]:
    """Return the lines that `verify` prints for two different logs."""
    lines = [f"{key}: {one or 'none'} | {other or 'none'}" for key, (one, other) in comparison.about.items()]
    lines += [
        f"only in the {file}: {', '.join(topics)}"
        for file, topics in zip(("first", "second"), comparison.only, strict=True)
        if topics
    ]
    if comparison.first is None:
        return lines
    first = comparison.first
    values = " | ".join(map(str, first.values))
    lines.append(
        f"first difference: {first.topic} at t = {first.time_ns * 1e-9:g} s, {first.field or 'messages'}: {values}"
    )
    if first.growth:
        lines.append(f"  {'after [s]':>10}  {'apart by':>10}  {'true position apart by [m]':>26}")
    for growth in first.growth:
        position = f"{growth.position:26.3e}" if growth.position is not None else ""
        lines.append(f"  {growth.after:>10g}  {growth.apart:>10.3e}  {position}".rstrip())
    return lines
