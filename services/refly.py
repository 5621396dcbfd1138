"""Flies a recorded run again: its scene, and what came from outside at the ticks at which it applied."""

import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from rich.console import Console

from messages import OperatorInput
from messages.topics import OPERATOR
from services import flight
from services.log import LogReader
from services.progress import Display
from services.scene import Scene, recorded_scene
from services.sections import Exchange, Run, Vehicle


def flown_scene(read: LogReader) -> Scene:
    """The scene of a run's log, with the overrides of the run; ValueError if it carries none."""
    if "scene.toml" not in read.attachments or "scene" not in read.metadata:
        raise ValueError(f"{read.path}: carries no scene; expected a log that `lapwing run` has written")
    folder = Path(read.metadata.get("folder", "scenes"))
    return recorded_scene(read.metadata["scene"], folder, read.attachments["scene.toml"].decode())


def given_commands(read: LogReader, scene: Scene) -> Iterator[tuple[int, tuple[Any, ...]]]:
    """The commands from outside, with the ticks at which they applied."""
    interval = scene[Exchange].interval_ns
    for _, _, time_ns, payload in read.messages([OPERATOR.key(scene[Vehicle].name)]):
        yield time_ns // interval, OperatorInput.decode(payload).commands


def refly(log: Path, console: Console) -> tuple[str, str]:
    """Digests of the log, and of the run flown again up to the log's last tick.

    Raises:
        ValueError: no log, or none of a run.
    """
    with LogReader(log) as read:
        scene = flown_scene(read)
        interval = scene[Exchange].interval_ns
        given = dict(given_commands(read, scene))
        last = max((time_ns // interval for _, _, time_ns, _ in read.messages(read.deterministic_topics())), default=0)
        before = read.digest()
    flight.prepare(scene, console.print)
    with tempfile.TemporaryDirectory() as place, Display(console, scene[Run].duration) as display:
        again = Path(place) / "again.mcap"
        flight.fly_single(scene, again, None, display, lambda tick: given.get(tick, ()), last)
        with LogReader(again) as read:
            return before, read.digest()
