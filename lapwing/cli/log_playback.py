"""Playback of logs: publication with the recorded timing, and resimulation from the recorded inputs."""

import os
import select
import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from lapwing.cli.app import app
from lapwing.cli.error_exit import DIFFERENT, fail
from lapwing.cli.options import KeyPrefix, LinkOptions, LogFile, Speed, parse_speed, with_options
from lapwing.cli.output_paths import check_log
from lapwing.cli.run_options import check_published

if TYPE_CHECKING:
    from lapwing.services.mavlink.link_server import LinkServer


ENDPOINT = "tcp/127.0.0.1:7447"
ENDPOINT_ROS2 = "tcp/127.0.0.1:7448"  # the Zenoh router of a ROS 2 domain has port 7447


@dataclass(frozen=True, kw_only=True)
class ReplayOptions(LinkOptions):
    """Options of `lapwing replay`."""

    log: LogFile
    speed: Speed = "1"
    start: Annotated[float, typer.Option("--from", metavar="S", help="first simulation time to play")] = 0.0
    end: Annotated[float | None, typer.Option("--to", metavar="S", help="last simulation time to play")] = None
    loop: Annotated[bool, typer.Option("--loop", help="restart at the end")] = False
    topics: Annotated[
        str | None, typer.Option(metavar="TOPIC,...", help="play only these topics, e.g. /clock,/drone1/imu")
    ] = None
    key_prefix: KeyPrefix = "lapwing"
    listen: Annotated[
        str | None,
        typer.Option(
            metavar="ENDPOINT", help=f"endpoint at which subscribers connect [{ENDPOINT}; with --ros2 {ENDPOINT_ROS2}]"
        ),
    ] = None
    record: Annotated[Path | None, typer.Option(metavar="FILE", help="write the published messages to a log")] = None

    def validate(self) -> None:
        """Raise ValueError for options that are malformed, unsafe, or incompatible."""
        from lapwing.cosim.transport.bus_keys import check_key_prefix

        check_key_prefix(self.key_prefix)
        if self.record and self.loop:
            raise ValueError("--record and --loop exclude each other; remove one of them")
        if self.record and self.record.resolve() == self.log.resolve():
            raise ValueError(f"--record {self.record}: is the replayed log; choose another file")
        check_log(self.record)
        check_published("--listen", self.endpoint, self.insecure)
        self.validate_links()

    @property
    def endpoint(self) -> str:
        """Endpoint at which subscribers connect."""
        return self.listen or (ENDPOINT if self.ros2 is None else ENDPOINT_ROS2)


@app.command()
@with_options
def replay(options: ReplayOptions) -> None:
    """Publish a log on Zenoh with its recorded timing.

    Keys in a terminal: space pauses and resumes, a full stop plays the messages of the next time, q quits.
    """
    from lapwing.cosim.processes.interrupt import Stop
    from lapwing.services.replay.playback_timing import Cut, Pace
    from lapwing.services.replay.player import play

    log = options.log
    cut, factor = Cut.of(options.start, options.end), parse_speed(options.speed)
    options.validate()
    with ExitStack() as stack:
        servers = _link_servers(options, factor, stack)
        viewers = _viewers(options, stack)
        listeners: list[Callable[[str, int, bytes], None]] = [server.replay for server in servers.values()]
        listeners += [viewer.put for viewer in viewers]

        def wait(seconds: float) -> None:
            first, *others = servers.values()
            first.wait(seconds)
            for other in others:
                other.adapter.tick(time.monotonic())

        stop = stack.enter_context(Stop())
        keyboard = stack.enter_context(Keyboard())
        count = play(
            log,
            options.key_prefix,
            options.endpoint,
            cut,
            factor,
            options.loop,
            options.record,
            lambda: stop.number is not None,
            lambda *message: [listener(*message) for listener in listeners],
            Pace(keyboard.keys, typer.echo, wait if servers else time.sleep),
            options.topics.split(",") if options.topics is not None else None,
        )
        for name, server in servers.items():
            for line in server.report():
                typer.echo(f"mavlink: {f'{name}: ' if len(servers) > 1 else ''}{line}")
        stop.check()
    typer.echo(f"{log}: {count} messages published" + (f", recorded to {options.record}" if options.record else ""))


def _link_servers(options: ReplayOptions, speed: float | None, stack: ExitStack) -> "dict[str, LinkServer]":
    """Open the MAVLink links of each recorded vehicle, by its name; the first server polls for the others."""
    if not options.mavlink:
        return {}
    from lapwing.cosim.config.provenance import CONFIG_FILE
    from lapwing.cosim.diagram.multi_vehicle import members
    from lapwing.cosim.log import LogReader
    from lapwing.runs.resimulate import recorded_config
    from lapwing.services.mavlink.link_server import LinkServer, Options
    from lapwing.services.mavlink.links import for_vehicle_index
    from lapwing.services.mavlink.signing import read_key
    from lapwing.services.mavlink.vehicle_description import VehicleDescription

    with LogReader(options.log) as reader:
        if CONFIG_FILE in reader.attachments:
            vehicles = {m.vehicle: m.auxiliary.get("mavlink") for m in members(recorded_config(reader))}
        else:  # written by another tool
            vehicles = {next((t.split("/")[1] for t in reader.topics() if t.endswith("/status")), "drone1"): None}
    key = read_key(options.mavlink_key) if options.mavlink_key else None
    servers: dict[str, LinkServer] = {}
    for i, (name, description) in enumerate(vehicles.items()):
        urls = tuple(for_vehicle_index(url, i) for url in options.mavlink)
        link = Options(urls, key, options.insecure, options.log, speed=speed)
        first = next(iter(servers.values()), None)
        servers[name] = stack.enter_context(LinkServer(description or VehicleDescription(name), link, None, first))
    return servers


def _viewers(options: ReplayOptions, stack: ExitStack) -> list[Any]:
    """Start the Foxglove server and the ROS 2 node of the options, with all topics of the log declared."""
    from lapwing.cosim.log import LogReader

    viewers: list[Any] = []
    if options.foxglove is not None:
        from lapwing.services.foxglove.server import Server

        viewers.append(stack.enter_context(Server(options.foxglove, options.insecure)))
    if options.ros2 is not None:
        from lapwing.services.ros2.node import Node

        viewers.append(stack.enter_context(Node(options.ros2, options.router, options.insecure)))
    if viewers:
        with LogReader(options.log) as reader:
            topics = reader.topics()
        for viewer in viewers:
            for topic, kind in topics.items():
                viewer.declare(topic, kind)
    return viewers


@app.command()
def resimulate(
    log: LogFile,
    allow_code: Annotated[
        bool, typer.Option("--allow-code", help="allow Python modules and FMUs of the log to run")
    ] = False,
) -> None:
    """Repeat a recorded run from its log and compare digests.

    Exit codes: 1 the run failed, 2 invalid input, 3 the digests differ.
    """
    from lapwing.cli.progress import RunProgress
    from lapwing.runs import resimulate as runs
    from lapwing.services.common import foreign_code
    from lapwing.views.terminal import console

    with foreign_code.permission(allow_code):
        with RunProgress(console(), 0.0) as display:
            recorded, computed = runs.resimulate(log, display, allow_code)
        if recorded != computed:
            fail(f"{log}: digests differ: recorded {recorded}, resimulated {computed}", DIFFERENT)
        typer.echo(f"{log}: resimulated, digest {computed} is identical")


class Keyboard:
    """Context manager that reads single keys of a terminal without echo; other inputs have no keys."""

    def __init__(self, descriptor: int = 0):
        """Read keys of a file descriptor, by default standard input."""
        self._descriptor = descriptor
        self._before: Any = None
        self.available = os.isatty(descriptor) and _in_foreground(descriptor)

    def keys(self) -> str:
        """Return the keys that were typed since the last call."""
        if not self.available or not select.select([self._descriptor], [], [], 0.0)[0]:
            return ""
        typed = os.read(self._descriptor, 64)
        self.available = bool(typed)  # empty if the terminal was closed
        return typed.decode(errors="replace")

    def __enter__(self) -> "Keyboard":
        if self.available:
            import termios
            import tty

            self._before = termios.tcgetattr(self._descriptor)
            tty.setcbreak(self._descriptor)
        return self

    def __exit__(self, *_: object) -> None:
        if self._before is not None:
            import termios

            termios.tcsetattr(self._descriptor, termios.TCSADRAIN, self._before)


def _in_foreground(descriptor: int) -> bool:
    """Return True if this process owns the terminal: a background job would be stopped when it reads from it."""
    try:
        return os.tcgetpgrp(descriptor) == os.getpgrp()
    except OSError:  # not the terminal that controls this process
        return True
