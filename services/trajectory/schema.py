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

from collections.abc import Iterator
from typing import Any, ClassVar, Literal

from lapwing.cosim.scene import Files, Scene, SceneTable
from lapwing.cosim.scene.files import unvalidated_value
from lapwing.dynamics.config_error import ConfigError
from lapwing.services.common import user_modules
from lapwing.services.trajectory import user_segment
from lapwing.services.trajectory.phases import Phases
from lapwing.services.trajectory.segments.segment import Segment
from lapwing.services.trajectory.table_file import parse
from lapwing.services.trajectory.trajectory_compiler import CHANNELS, CompiledTrajectory, compile


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
                        segment["points"] = parse(files.text(f"{key}.points", f"{key}.file", path), path)

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
