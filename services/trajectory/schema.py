"""The `[trajectory]` table of a scene: named phases with the segments of each channel.

```toml
[[trajectory.phase]]
name = "climb"
z = { kind = "ramp", to = 10.0, rate = 1.0 }

[[trajectory.phase]]
name = "hover"
duration = 5.0
```

Instead of phases, a scene may list points, of which `waypoints.phases` makes phases:

```toml
[trajectory]
waypoints = [
  [0.0, 0.0, 5.0],
  { x = 20.0, y = 0.0, z = 5.0, yaw_deg = 90.0 },
  { latitude_deg = 40.7687, longitude_deg = 14.7909, z = 8.0 },
]
speed = 3.0
turn = "round"
```

Values are displacements from the vehicle's initial pose in world axes; z = 0 is the ground; a trajectory that ends at
the height of an obstacle below it lands there. With `leader` they are displacements relative to the leader's
trajectory. Channels without a segment hold. A channel may have a list of consecutive segments. A segment with the key
`module` is of a class in that user module. A phase lasts `duration`, by default as long as its longest channel; shorter
channels hold.
"""

import csv
import math
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, ClassVar, Literal

from pydantic import model_validator

from lapwing.cosim.scene import Files, KeyOrigin, Scene, SceneError, SceneTable
from lapwing.cosim.scene.files import unvalidated_value
from lapwing.dynamics.config_error import ConfigError
from lapwing.dynamics.terrain import Level, surface
from lapwing.dynamics.validation import validated
from lapwing.kernels import python_function
from lapwing.services.common import user_modules
from lapwing.services.common.schemas.environment_schema import environment
from lapwing.services.common.schemas.place_schema import home_of
from lapwing.services.common.schemas.vehicle_schema import Vehicle, start_place
from lapwing.services.trajectory import phases, waypoints
from lapwing.services.trajectory.phases import Phases
from lapwing.services.trajectory.polynomial_piece import channel_at
from lapwing.services.trajectory.segments.segment import Segment
from lapwing.services.trajectory.trajectory_compiler import CHANNELS, GROUNDED, CompiledTrajectory, compile
from lapwing.services.trajectory.waypoints import Route, Waypoint

ROUTE = set(Route.model_fields)
TABLE_HEADER = ["time", "value"]
_channel_at = python_function(channel_at)


class Trajectory(Route, Phases, SceneTable):
    """The trajectory to fly."""

    TABLE: ClassVar[str] = "trajectory"
    OPTIONAL: ClassVar[bool] = True
    leader: str | None = None  # name of the vehicle relative to whose trajectory the phases are defined
    frame: Literal["heading", "world"] | None = None  # axes of the phases: the leader's heading [heading], or world

    @model_validator(mode="before")
    @classmethod
    def _from_waypoints(cls, table: Any) -> Any:
        """Add the phases of the waypoints, which are validated first."""
        if not isinstance(table, dict) or not (given := {key: table[key] for key in ROUTE if key in table}):
            return table
        if "waypoints" not in given:
            raise ConfigError(next(iter(given)), "applies to waypoints only", "waypoints, or rates of the segments")
        if "phase" in table:
            raise ConfigError("waypoints", "got waypoints and phases", "one of the two")
        route = validated(Route.model_validate, given, Route)
        return {**table, "phase": waypoints.phases(route)}

    def resolved(self) -> dict[str, Any]:
        """Return the waypoints or the phases, whichever the scene has, and the other keys."""
        return self.model_dump(exclude_none=True, exclude={"phase"} if self.waypoints else ROUTE)

    @classmethod
    def embed(cls, tree: dict[str, Any], files: Files) -> None:
        """Convert waypoint tables to lists, store user modules, read the CSV files of segments of kind "table"."""
        points = unvalidated_value(tree, cls.TABLE, "waypoints")
        for i, point in enumerate(points if isinstance(points, list) else ()):
            key = f"{cls.TABLE}.waypoints.{i}"
            if isinstance(point, dict):
                points[i] = _place(tree, key, point)
            elif isinstance(point, list) and len(point) not in (3, 4):
                raise ConfigError(key, f"got {point}", "x, y, z [m], and optionally the yaw [rad]")
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
                        path = files.path(f"{key}.file", file)
                        segment["points"] = parse_table(files.text(f"{key}.points", f"{key}.file", path), path)

    def check(self, scene: Scene) -> None:
        """Raise ConfigError for gaps between segments, short phases, points below ground, a frame without a leader."""
        path, _, duration, _ = compile_trajectory(scene)
        ground = _ground(scene)
        for i, (x, y, z, *_) in enumerate(() if self.leader else self.waypoints):
            if z < (height := ground(x, y)) - GROUNDED:
                raise ConfigError(
                    f"trajectory.waypoints.{i}", f"got {z:g} m", f"z of at least {height:.3g} m, the ground there"
                )
        for i, end in enumerate(() if self.leader or self.waypoints else (*path.phase_start[1:], duration)):
            x, y, z = (_channel_at(channel, end)[0] for channel in (path.x, path.y, path.z))
            if z < (height := min(0.0, ground(x, y))) - GROUNDED:
                expected = f"an end of at least {height:.3g} m, the ground there"
                raise ConfigError(f"trajectory.phase.{i}.z", f"got {z:g} m", expected)
        if self.frame and not self.leader:
            raise ConfigError("trajectory.frame", "has no leader", "trajectory.leader, or no frame")


def _place(tree: dict[str, Any], key: str, point: dict[str, Any]) -> list[float]:
    """Return a waypoint in metres. Raise ConfigError with its key in the scene."""
    start = unvalidated_value(tree, Vehicle.TABLE, "initial_position") or (0.0, 0.0)
    try:
        return validated(Waypoint.model_validate, point, Waypoint).point(home_of(tree), start)
    except ConfigError as error:
        raise error.with_prefix(key) from None


def compile_trajectory(scene: Scene) -> CompiledTrajectory:
    """Return the scene's trajectory about the origin. See `compile` for errors."""
    return scene.cached(_compile)


def _compile(scene: Scene) -> CompiledTrajectory:
    trajectory = scene[Trajectory]
    phases.load(scene, _keyed_segments(trajectory))
    return compile(trajectory, ground=_ground(scene))


def _ground(scene: Scene) -> Callable[[float, float], float]:
    """Return the height [m] of the ground, or of an obstacle, over that at the start, at a displacement x, y [m]."""
    terrain = environment(scene).terrain
    if isinstance(terrain, Level) or scene[Trajectory].leader:
        return lambda x, y: 0.0
    x0, y0, _ = start_place(scene)
    start = surface(terrain, x0, y0)[0]
    return lambda x, y: float(surface(terrain, x0 + x, y0 + y)[0] - start)


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
