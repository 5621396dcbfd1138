"""A log again: published as it was, or flown with its inputs."""

from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from lapwing.cli.app import app
from lapwing.cli.errors import fail, user_errors
from lapwing.cli.files import check_writable
from lapwing.cli.links import check_links, mavlink_options
from lapwing.cli.options import (
    Insecure,
    KeyPrefix,
    MavlinkKey,
    MavlinkUrls,
    Speed,
    parse_speed,
)

if TYPE_CHECKING:
    from services.mavlink.hub import Hub
    from services.mavlink.options import Options


def _recorded_hub(log: Path, options: "Options") -> "Hub":
    from cosim.log import LogReader
    from cosim.provenance import SETUP_FILE
    from lapwing.runs.refly import recorded_setup
    from services.mavlink.hub import Hub
    from services.mavlink.vehicle import VehicleDescription

    with LogReader(log) as recorded:
        if SETUP_FILE not in recorded.attachments:  # another tool's, or a part of one
            named = next((topic.split("/")[1] for topic in recorded.topics() if topic.endswith("/status")), "drone1")
            return Hub(VehicleDescription(named), options, None)
        setup = recorded_setup(recorded)
    return Hub(setup.beside.get("mavlink", VehicleDescription(setup.vehicle)), options, None)


@app.command()
def replay(
    log: Annotated[Path, typer.Argument(metavar="FILE", help="an MCAP log of a run")],
    speed: Speed = "1",
    start: Annotated[float, typer.Option("--from", metavar="S", help="begin at this simulation time")] = 0.0,
    end: Annotated[float | None, typer.Option("--to", metavar="S", help="end at this simulation time")] = None,
    loop: Annotated[bool, typer.Option("--loop", help="begin again at the end")] = False,
    key_prefix: KeyPrefix = "lapwing",
    listen: Annotated[str, typer.Option(metavar="ENDPOINT", help="where subscribers connect")] = "tcp/127.0.0.1:7447",
    record: Annotated[Path | None, typer.Option(metavar="FILE", help="also write what is published to a log")] = None,
    mavlink: MavlinkUrls = None,
    mavlink_key: MavlinkKey = None,
    insecure: Insecure = False,
) -> None:
    """Publish a log on Zenoh with its own timing, as the live run did."""
    from cosim.interrupt import Stop
    from cosim.key_prefix import reserve
    from services.replay.player import play
    from services.replay.schedule import Cut

    with user_errors():
        cut, pace = Cut.of(start, end), parse_speed(speed)
        if record and loop:
            raise ValueError("--record and --loop exclude each other: a log has an end")
        if record and record.resolve() == log.resolve():
            raise ValueError(f"--record {record}: is the log that is replayed; choose another file")
        check_writable(record)
        check_links(mavlink, mavlink_key, insecure)
        with ExitStack() as stack:
            hub = None
            if mavlink:
                options = mavlink_options(mavlink, mavlink_key, insecure, log, pace)
                hub = stack.enter_context(_recorded_hub(log, options))
            stack.enter_context(reserve(key_prefix))
            stop = stack.enter_context(Stop())
            listeners = (hub.replay, hub.wait) if hub else ()
            count = play(log, key_prefix, listen, cut, pace, loop, record, lambda: stop.number is not None, *listeners)
            for line in hub.report() if hub else ():
                typer.echo(f"mavlink: {line}")
            stop.check()
        typer.echo(f"{log}: {count} messages published" + (f", recorded to {record}" if record else ""))


@app.command()
def refly(
    log: Annotated[Path, typer.Argument(metavar="FILE", help="an MCAP log of a run")],
    run_code: Annotated[bool, typer.Option("--run-code", help="run the Python modules that the log carries")] = False,
) -> None:
    """Fly a log's scene again with the recorded commands at their ticks: the same digest, or exit code 1."""
    from lapwing.cli.progress import Display
    from lapwing.runs import refly as again
    from studies.terminal import console

    with user_errors():
        with Display(console(), 0.0) as display:
            before, after = again.refly(log, display, run_code)
        if before != after:
            fail(f"{log}: digest {before}, flown again {after}: not the same", 1)
        typer.echo(f"{log}: flown again, the same digest {after}")
