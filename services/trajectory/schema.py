"""The `[trajectory]` of a scene: named phases, in each the segments of the channels that move.

```toml
[[trajectory.phase]]
name = "climb"
z = { kind = "ramp", to = 10.0, rate = 1.0 }

[[trajectory.phase]]
name = "hover"
duration = 5.0
```

Values are displacements from the vehicle's pose at the start, in world axes: z = 0 stands on the ground again.
With `follow` they are displacements from where it stands beside another vehicle at the start, as that one flies on.
A channel that a phase does not name holds. A channel may have a list of segments, joined in time. A phase lasts
`duration`, or else as long as its longest channel; channels that end earlier hold.
"""

from typing import Any, ClassVar, Literal

from lapwing.cosim.scene import Files, Scene, SceneTable
from lapwing.cosim.scene.files import named
from lapwing.dynamics.config_error import ConfigError
from lapwing.services.trajectory.phases import Phases
from lapwing.services.trajectory.table_file import parse
from lapwing.services.trajectory.trajectory_compiler import CHANNELS, CompiledTrajectory, compile


class Trajectory(Phases, SceneTable):
    """What the vehicle is asked to fly."""

    TABLE: ClassVar[str] = "trajectory"
    OPTIONAL: ClassVar[bool] = True
    follow: str | None = None  # name of the vehicle of the fleet relative to whose trajectory the phases are
    frame: Literal["heading", "world"] | None = None  # of the phases' axes: turning with the leader [heading], or not

    @classmethod
    def embed(cls, tree: dict[str, Any], files: Files) -> None:
        """The CSV file that a segment of kind "table" names becomes its points."""
        phases = named(tree, cls.TABLE, "phase")
        for i, phase in enumerate(phases if isinstance(phases, list) else ()):
            for channel in CHANNELS if isinstance(phase, dict) else ():
                given = phase.get(channel, ())
                several = isinstance(given, list)
                for k, segment in enumerate(given if several else [given]):
                    if isinstance(segment, dict) and isinstance(file := segment.get("file"), str):
                        key = f"trajectory.phase.{i}.{channel}" + (f".{k}" if several else "")
                        path = files.folder / file
                        segment["points"] = parse(files.text(f"{key}.points", f"{key}.file", path), path)

    def check(self, scene: Scene) -> None:
        """The segments join, phases are long enough; a frame is that of a leader."""
        compiled(scene)
        if self.frame and not self.follow:
            raise ConfigError("trajectory.frame", "there is no leader whose it could be", "trajectory.follow, or none")


def compiled(scene: Scene) -> CompiledTrajectory:
    """The scene's trajectory about the origin; ConfigError as of `compile`."""
    return scene.once(_compiled)


def _compiled(scene: Scene) -> CompiledTrajectory:
    return compile(scene[Trajectory])
