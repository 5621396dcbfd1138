"""The `[trajectory]` table of a scene: named phases with the segments of each channel.

```toml
[[trajectory.phase]]
name = "climb"
z = { kind = "ramp", to = 10.0, rate = 1.0 }

[[trajectory.phase]]
name = "hover"
duration = 5.0
```

Values are displacements from the vehicle's initial pose in world axes; z = 0 is the ground. With `leader` they are
displacements relative to the leader's trajectory. Channels without a segment hold. A channel may have a list of
consecutive segments. A segment with the key `module` is of a class in that user module. A phase lasts `duration`, by
default as long as its longest channel; shorter channels hold.
"""

import csv
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any, ClassVar, Literal

from lapwing.cosim.scene import Files, KeyOrigin, Scene, SceneError, SceneTable
from lapwing.cosim.scene.files import unvalidated_value
from lapwing.dynamics.config_error import ConfigError
from lapwing.services.common import user_modules
from lapwing.services.trajectory import user_segment
from lapwing.services.trajectory.phases import Phases
from lapwing.services.trajectory.segments.segment import Segment
from lapwing.services.trajectory.trajectory_compiler import CHANNELS, CompiledTrajectory, compile

TABLE_HEADER = ["time", "value"]


class Trajectory(Phases, SceneTable):
    """The trajectory to fly."""

    TABLE: ClassVar[str] = "trajectory"
    OPTIONAL: ClassVar[bool] = True
    leader: str | None = None  # name of the vehicle relative to whose trajectory the phases are defined
    frame: Literal["heading", "world"] | None = None  # axes of the phases: the leader's heading [heading], or world

    @classmethod
    def embed(cls, tree: dict[str, Any], files: Files) -> None:
        """Store the modules of user segments, and read the CSV file of a segment of kind "table" into its points."""
        phases = unvalidated_value(tree, cls.TABLE, "phase")
        for i, phase in enumerate(phases if isinstance(phases, list) else ()):
            for channel in CHANNELS if isinstance(phase, dict) else ():
                segments = phase.get(channel, ())
                several = isinstance(segments, list)
                for k, segment in enumerate(segments if several else [segments]):
                    if not isinstance(segment, dict):
                        continue
                    key = f"trajectory.phase.{i}.{channel}" + (f".{k}" if several else "")
                    if isinstance(module := segment.get("module"), str):
                        user_modules.embed(tree, files, f"{key}.module", module)
                    elif isinstance(file := segment.get("file"), str):
                        path = files.folder / file
                        segment["points"] = parse_table(files.text(f"{key}.points", f"{key}.file", path), path)

    def check(self, scene: Scene) -> None:
        """Raise ConfigError unless the segments join, phases are long enough, and a frame has a leader."""
        compile_trajectory(scene)
        if self.frame and not self.leader:
            raise ConfigError("trajectory.frame", "has no leader", "trajectory.leader, or no frame")


def compile_trajectory(scene: Scene) -> CompiledTrajectory:
    """Return the scene's trajectory about the origin. See `compile` for errors."""
    return scene.cached(_compile)


def _compile(scene: Scene) -> CompiledTrajectory:
    trajectory = scene[Trajectory]
    user_segment.load(scene, _keyed_segments(trajectory))
    return compile(trajectory)


def _keyed_segments(trajectory: Trajectory) -> Iterator[tuple[str, Segment]]:
    for i, phase in enumerate(trajectory.phase):
        for channel in CHANNELS:
            yield from ((f"trajectory.phase.{i}.{channel}", segment) for segment in getattr(phase, channel))


def parse_table(text: str, path: Path) -> list[list[float]]:
    """Return the points [time [s], value] in the text of a CSV file with the header `time,value`.

    Raises:
        SceneError: with the line of an invalid header or row, or of a time that does not ascend from 0.
    """
    rows = list(csv.reader(text.splitlines()))
    if not rows or [cell.strip() for cell in rows[0]] != TABLE_HEADER:
        raise _table_error(path, 1, ",".join(rows[0]) if rows else "", "the header time,value")
    points: list[list[float]] = []
    for number, row in enumerate(rows[1:], start=2):
        try:
            time, value = (float(cell) for cell in row)
        except ValueError:
            raise _table_error(path, number, ",".join(row), "two numbers") from None
        if not (math.isfinite(time) and math.isfinite(value)):
            raise _table_error(path, number, ",".join(row), "finite numbers")
        if (points and time <= points[-1][0]) or (not points and time != 0.0):
            raise _table_error(path, number, str(time), "times that start at 0 and ascend")
        points.append([time, value])
    if len(points) < 2:
        raise _table_error(path, len(rows), str(len(points)), "at least two points")
    return points


def _table_error(path: Path, line: int, actual: str, expected: str) -> SceneError:
    return SceneError("", f"got {actual!r}", expected, KeyOrigin(path, line))
