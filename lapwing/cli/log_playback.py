"""A log again: published as it was, or flown with its inputs."""

import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from lapwing.cli.app import app
from lapwing.cli.endpoint_checks import check_links, check_published, check_ros2, mavlink_options
from lapwing.cli.error_exit import fail, user_errors
from lapwing.cli.options import (
    FoxgloveAddress,
    Insecure,
    KeyPrefix,
    MavlinkKey,
    MavlinkUrls,
    Ros2Domain,
    Ros2Router,
    Speed,
    parse_speed,
)
from lapwing.cli.output_paths import check_log

if TYPE_CHECKING:
    from lapwing.services.mavlink.link_options import Options
    from lapwing.services.mavlink.link_server import LinkServer


def _recorded_hubs(log: Path, options: "Options", stack: ExitStack) -> "dict[str, LinkServer]":
    """The links of each vehicle of a log, by its name; those of a fleet wait with the first's."""
    from lapwing.cosim.config.provenance import SETUP_FILE
    from lapwing.cosim.diagram.multi_vehicle import members
    from lapwing.cosim.log import LogReader
    from lapwing.runs.resimulate import recorded_setup
    from lapwing.services.mavlink.link_server import LinkServer
    from lapwing.services.mavlink.links import numbered
    from lapwing.services.mavlink.vehicle_description import VehicleDescription

    with LogReader(log) as recorded:
        if SETUP_FILE in recorded.attachments:
            flown = {m.vehicle: m.beside.get("mavlink") for m in members(recorded_setup(recorded))}
        else:  # another tool's, or a part of one
            flown = {next((t.split("/")[1] for t in recorded.topics() if t.endswith("/status")), "drone1"): None}
    hubs: dict[str, LinkServer] = {}
    for i, (name, description) in enumerate(flown.items()):
        own = options._replace(urls=tuple(numbered(url, i) for url in options.urls))
        hub = LinkServer(description or VehicleDescription(name), own, None, next(iter(hubs.values()), None))
        hubs[name] = stack.enter_context(hub)
    return hubs


def _topics(log: Path) -> dict[str, str]:
    """The type of each topic of a log."""
    from lapwing.cosim.log import LogReader

    with LogReader(log) as recorded:
        return recorded.topics()


@app.command()
def replay(
    log: Annotated[Path, typer.Argument(metavar="FILE", help="an MCAP log of a run")],
    speed: Speed = "1",
    start: Annotated[float, typer.Option("--from", metavar="S", help="begin at this simulation time")] = 0.0,
    end: Annotated[float | None, typer.Option("--to", metavar="S", help="end at this simulation time")] = None,
    loop: Annotated[bool, typer.Option("--loop", help="begin again at the end")] = False,
    topics: Annotated[str | None, typer.Option(metavar="TOPIC,...", help="only these: /clock,/drone1/imu")] = None,
    key_prefix: KeyPrefix = "lapwing",
    listen: Annotated[str, typer.Option(metavar="ENDPOINT", help="where subscribers connect")] = "tcp/127.0.0.1:7447",
    record: Annotated[Path | None, typer.Option(metavar="FILE", help="also write what is published to a log")] = None,
    mavlink: MavlinkUrls = None,
    mavlink_key: MavlinkKey = None,
    insecure: Insecure = False,
    foxglove: FoxgloveAddress = None,
    ros2: Ros2Domain = None,
    ros2_router: Ros2Router = None,
) -> None:
    """Publish a log on Zenoh with its own timing, as the live run did.

    In a terminal the space bar holds it and lets it go on, a full stop lets one instant go, q ends it.
    """
    from lapwing.cli.keyboard import Keyboard
    from lapwing.cosim.processes.interrupt import Stop
    from lapwing.cosim.transport.key_prefix import check_key_prefix
    from lapwing.services.foxglove.server import check_address
    from lapwing.services.replay.playback_clock import Pace
    from lapwing.services.replay.playback_schedule import Cut
    from lapwing.services.replay.player import play

    with user_errors():
        check_key_prefix(key_prefix)
        cut, factor = Cut.of(start, end), parse_speed(speed)
        if record and loop:
            raise ValueError("--record and --loop exclude each other: a log has an end")
        if record and record.resolve() == log.resolve():
            raise ValueError(f"--record {record}: is the log that is replayed; choose another file")
        check_log(record)
        check_published("--listen", listen, insecure)
        check_links(mavlink, mavlink_key)
        if foxglove is not None:
            check_address(foxglove, insecure)
        router = check_ros2(ros2, ros2_router, insecure)
        with ExitStack() as stack:
            hubs: dict[str, LinkServer] = {}
            if mavlink:
                hubs = _recorded_hubs(log, mavlink_options(mavlink, mavlink_key, insecure, log, factor), stack)
            listeners: list[Callable[[str, int, bytes], None]] = [hub.replay for hub in hubs.values()]

            def wait(seconds: float) -> None:
                leading, *others = hubs.values()
                leading.wait(seconds)
                for other in others:
                    other.adapter.tick(time.monotonic())

            viewers: list[Any] = []
            if foxglove is not None or ros2 is not None:
                kinds = _topics(log)
            if foxglove is not None:
                from lapwing.services.foxglove.server import Server

                viewers.append(stack.enter_context(Server(foxglove, insecure)))
            if ros2 is not None:
                from lapwing.services.ros2.node import Node

                viewers.append(stack.enter_context(Node(ros2, router, insecure)))
            for viewer in viewers:
                for topic, kind in kinds.items():
                    viewer.declare(topic, kind)
                listeners.append(viewer.put)
            stop = stack.enter_context(Stop())
            keyboard = stack.enter_context(Keyboard())
            pace = Pace(keyboard.keys, typer.echo, wait if hubs else time.sleep)
            count = play(
                log,
                key_prefix,
                listen,
                cut,
                factor,
                loop,
                record,
                lambda: stop.number is not None,
                lambda *message: [listener(*message) for listener in listeners],
                pace,
                topics.split(",") if topics is not None else None,
            )
            for name, hub in hubs.items():
                for line in hub.report():
                    typer.echo(f"mavlink: {f'{name}: ' if len(hubs) > 1 else ''}{line}")
            stop.check()
        typer.echo(f"{log}: {count} messages published" + (f", recorded to {record}" if record else ""))


@app.command()
def refly(
    log: Annotated[Path, typer.Argument(metavar="FILE", help="an MCAP log of a run")],
    run_code: Annotated[bool, typer.Option("--run-code", help="run the Python modules that the log carries")] = False,
) -> None:
    """Fly a log's scene again with the recorded commands at their ticks: the same digest, or exit code 1."""
    from lapwing.cli.progress import Display
    from lapwing.runs import resimulate as again
    from lapwing.studies.terminal import console

    with user_errors():
        with Display(console(), 0.0) as display:
            before, after = again.refly(log, display, run_code)
        if before != after:
            fail(f"{log}: digest {before}, flown again {after}: not the same", 1)
        typer.echo(f"{log}: flown again, the same digest {after}")
