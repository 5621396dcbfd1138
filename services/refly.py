"""Flies a recorded run again: its scene, and what came from outside at the ticks at which it applied."""

import tempfile
from pathlib import Path

from rich.console import Console

from messages import OperatorInput
from messages.topics import OPERATOR
from services import flight
from services.log import LogReader
from services.progress import Display
from services.scene import recorded_scene
from services.sections import Exchange, Run, Vehicle


def refly(log: Path, console: Console) -> tuple[str, str]:
    """Digests of the log, and of the run flown again up to the log's last tick.

    Raises:
        ValueError: no log, or none of a run.
    """
    with LogReader(log) as read:
        if "scene.toml" not in read.attachments or "scene" not in read.metadata:
            raise ValueError(f"{log}: carries no scene; expected a log that `lapwing run` has written")
        folder = Path(read.metadata.get("folder", "scenes"))
        scene = recorded_scene(read.metadata["scene"], folder, read.attachments["scene.toml"].decode())
        interval, topic = scene[Exchange].interval_ns, OPERATOR.key(scene[Vehicle].name)
        given, last = {}, 0
        for name, _, time_ns, payload in read.messages(read.deterministic_topics()):
            last = max(last, time_ns // interval)
            if name == topic:
                given[time_ns // interval] = OperatorInput.decode(payload).commands
        before = read.digest()
    flight.prepare(scene, console.print)
    with tempfile.TemporaryDirectory() as place, Display(console, scene[Run].duration) as display:
        again = Path(place) / "again.mcap"
        flight.fly_single(scene, again, None, display, lambda tick: given.get(tick, ()), last)
        with LogReader(again) as read:
            return before, read.digest()
