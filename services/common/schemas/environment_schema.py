"""The `[environment]` table of a scene: place, date, atmosphere, terrain."""

import datetime
from functools import lru_cache
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import Field, ValidationError

from lapwing.cosim.scene import Files, Scene, SceneTable
from lapwing.dynamics.atmosphere import Atmosphere
from lapwing.dynamics.config_error import ConfigError
from lapwing.dynamics.environment import FIRST_YEAR, LAST_YEAR, STANDARD, Environment, magnetic_field
from lapwing.dynamics.geodesy import Home, normal_gravity
from lapwing.dynamics.terrain import Level, Relief, relief
from lapwing.dynamics.validation import Table
from lapwing.dynamics.vector import Vec3
from lapwing.services.common.schemas import height_file

Length = Annotated[float, Field(gt=0.0, le=1e4)]
Place = Annotated[float, Field(ge=-1e5, le=1e5)]
Height = Annotated[float, Field(ge=-1e4, le=1e4)]
Rise = Annotated[float, Field(ge=-1.0, le=1.0)]
Name = Annotated[str, Field(max_length=40)]
Turn = Annotated[float, Field(ge=-6.2832, le=6.2832)]
Tesla = Annotated[float, Field(ge=-1e-4, le=1e-4)]
MagneticField = Annotated[tuple[Tesla, Tesla, Tesla], Field(strict=False)]
Heights = Annotated[tuple[float, ...], Field(strict=False)]
Pair = Annotated[tuple[Place, Place], Field(strict=False)]


class Steps(Table):
    """Level treads and vertical risers along a direction, starting at home."""

    distance: tuple[Length, ...] = Field(strict=False)  # [m] from home to each riser, ascending
    rise: tuple[Height, ...] = Field(strict=False)  # [m] of each, negative if downwards
    heading: Turn = 0.0  # [rad] direction in which they are lined up, 0 along x

    def pairs(self) -> list[tuple[float, float]]:
        """Return (distance, rise) of each step. Raise ConfigError if the keys differ in length."""
        if len(self.distance) != len(self.rise):
            raise ConfigError("steps.rise", f"got {len(self.rise)}", f"one for each distance ({len(self.distance)})")
        return list(zip(self.distance, self.rise, strict=True))


class Grid(Table):
    """Heights on a grid relative to the height at home, bicubic between points, level two spacings beyond the edge."""

    file: str | None = None  # path relative to the scene: an .npy array, rows along world y, columns along x; a GeoTIFF
    heights: tuple[Heights, ...] | None = Field(default=None, strict=False)  # [m] rows, instead of a file
    corner: Pair | None = None  # [m] world x and y of the first row and column; default (0, 0), or from reach
    spacing: Length = 1.0  # [m] between neighbours
    reach: Length | None = None  # [m] from home to each side of the square that is read from a GeoTIFF


class Box(Table):
    """A box on the ground with a level top: a landing place or an obstacle."""

    position: Pair  # [m] world x and y of its centre
    size: Annotated[tuple[Length, Length], Field(strict=False)]  # [m] length along its heading, width across
    top: Height  # [m] world z of its top
    heading: Turn = 0.0  # [rad] of its length, 0 along x
    name: Name = ""  # in reports of contacts; default "building N"


class Cylinder(Table):
    """An upright cylinder on the ground with a level top."""

    position: Pair  # [m] world x and y of its axis
    radius: Length  # [m] of the cylinder
    top: Height  # [m] world z of its top
    name: Name = ""  # in reports of contacts; default "tower N"


class Terrain(Table):
    """The ground: sum of slope, bumps and grid, or steps; with boxes and cylinders on it. Level without keys."""

    slope: Annotated[tuple[Rise, Rise], Field(strict=False)] = (0.0, 0.0)  # rise of the ground along world x and y
    bump_height: Annotated[float, Field(ge=0.0, le=100.0)] = 0.0  # [m] amplitude A of bumps A sin(k x) sin(k y)
    bump_length: Annotated[float, Field(ge=0.01, le=1e4)] = 1.0  # [m] their wavelength 2 pi / k
    steps: Steps | None = None
    grid: Grid | None = None
    box: tuple[Box, ...] = Field(default=(), strict=False)  # boxes with level tops
    cylinder: tuple[Cylinder, ...] = Field(default=(), strict=False)  # upright cylinders with level tops

    def ground(self) -> Level | Relief:
        """Return the terrain for compiled code. Raise ConfigError with a key relative to this table."""
        grid, steps = self.grid, self.steps
        if grid and grid.heights is None:
            raise ConfigError("grid", "has neither file nor heights", "one of them")
        rows = [len(row) for row in grid.heights or ()] if grid else []
        if len(set(rows)) > 1:
            raise ConfigError("grid.heights", f"got rows of {min(rows)} to {max(rows)} numbers", "rows of equal length")
        return relief(
            self.slope,
            self.bump_height,
            self.bump_length,
            steps.pairs() if steps else (),
            steps.heading if steps else 0.0,
            [(*box.position, *box.size, box.heading, box.top) for box in self.box],
            [(*cylinder.position, cylinder.radius, cylinder.top) for cylinder in self.cylinder],
            np.array(grid.heights) if grid else None,
            grid.corner or (0.0, 0.0) if grid else (0.0, 0.0),
            grid.spacing if grid else 1.0,
        )


class EnvironmentTable(SceneTable):
    """Home on the Earth, date, atmosphere, gravity, magnetic field and terrain."""

    TABLE: ClassVar[str] = "environment"
    SHARED: ClassVar[bool] = True
    date: str = Field(default="2025-07-01", pattern=r"^\d{4}-\d{2}-\d{2}$")  # date of the magnetic field
    gravity_model: Literal["standard", "wgs84"] = "standard"  # 9.80665 m/s^2, or from home's latitude
    gravity: float | None = Field(default=None, ge=0.0, le=30.0)  # [m/s^2] at sea level, instead of the model's
    magnetic_field: MagneticField | None = None  # [T] east, north, up; default: the World Magnetic Model at home
    magnetic_anomaly: MagneticField = (0.0, 0.0, 0.0)  # [T] east, north, up, on top of it; unknown to the autopilot
    home: Home = STANDARD.home
    atmosphere: Atmosphere = STANDARD.atmosphere
    terrain: Terrain = Terrain()

    @classmethod
    def embed(cls, tree: dict[str, Any], files: Files) -> None:
        """Read the file of a grid into its `heights`."""
        try:
            environment_table = cls.model_validate(tree.get(cls.TABLE, {}))
        except ValidationError:
            return  # reported with its key when all tables are validated
        grid, key = environment_table.terrain.grid, "environment.terrain.grid"
        if grid is None or grid.file is None:
            if grid and grid.reach is not None:
                raise ConfigError(f"{key}.reach", "needs a GeoTIFF", "no reach, or the file of a GeoTIFF")
            return
        if grid.heights is not None:
            raise ConfigError(key, "has file and heights", "one of them")
        path, table = files.path(f"{key}.file", grid.file), tree[cls.TABLE]["terrain"]["grid"]
        if path.suffix in height_file.GEOTIFF:
            points = _points(grid, key)
            heights = height_file.of_geotiff(f"{key}.file", path, environment_table.home, points, grid.spacing)
            table["corner"] = [-points * grid.spacing] * 2
        elif path.suffix != ".npy":
            raise ConfigError(f"{key}.file", f"got {path.name!r}", "the path of an .npy file or a GeoTIFF (.tif)")
        elif grid.reach is not None:
            raise ConfigError(f"{key}.reach", "needs a GeoTIFF", "no reach, or the file of a GeoTIFF")
        else:
            heights = height_file.of_array(f"{key}.file", path)
        table["heights"] = heights.tolist()

    def check(self, scene: Scene) -> None:
        """Raise ConfigError if the date or the terrain is invalid."""
        try:
            _resolve(self)
        except ConfigError as error:
            raise error.with_prefix(self.TABLE) from None

    def resolved(self) -> dict[str, Any]:
        """Return the table with plain nested values."""
        return {**super().resolved(), "home": self.home._asdict(), "atmosphere": self.atmosphere._asdict()}


@lru_cache(maxsize=16)
def _resolve(table: EnvironmentTable) -> Environment:
    """Return the environment in numbers. Raise ConfigError with a key relative to the table."""
    try:
        terrain = table.terrain.ground()
    except ConfigError as error:
        raise error.with_prefix("terrain") from None
    east, north, up = _known_field(table)
    anomaly = table.magnetic_anomaly
    field = (east + anomaly[0], north + anomaly[1], up + anomaly[2])
    gravity = table.gravity
    if gravity is None:
        gravity = normal_gravity(table.home.latitude_deg) if table.gravity_model == "wgs84" else STANDARD.gravity
    return Environment(table.home, table.atmosphere, gravity, field, terrain)


def _known_field(table: EnvironmentTable) -> Vec3:
    """Return the field [T] without the anomaly."""
    return table.magnetic_field or magnetic_field(table.home, _day(table.date))


def _day(date: str) -> datetime.date:
    try:
        day = datetime.date.fromisoformat(date)
    except ValueError as error:
        raise ConfigError("date", f"got {date}: {error}", "a date such as 2025-07-01") from None
    if not FIRST_YEAR <= day.year <= LAST_YEAR:
        expected = f"a date from {FIRST_YEAR} to {LAST_YEAR}, or magnetic_field"
        raise ConfigError("date", f"got {date}, which no World Magnetic Model covers", expected)
    return day


def _points(grid: Grid, key: str) -> int:
    """Return the number of grid points of a GeoTIFF from home to each side."""
    if grid.reach is None:
        raise ConfigError(f"{key}.reach", "missing", "distance [m] from home to each side of the square to read")
    if grid.corner is not None:
        raise ConfigError(f"{key}.corner", "cannot be set with a GeoTIFF", "reach only")
    points = int(grid.reach / grid.spacing)
    if points < 1:
        raise ConfigError(f"{key}.reach", f"got {grid.reach:g}", f"at least the spacing of {grid.spacing:g} m")
    side = 2 * points + 1
    if side * side > height_file.MOST:
        expected = f"at most {height_file.MOST} points: a shorter reach or a wider spacing"
        raise ConfigError(f"{key}.spacing", f"got {grid.spacing:g} over a reach of {grid.reach:g} m", expected)
    return points


def environment(scene: Scene) -> Environment:
    """Return the environment that all services of the scene share."""
    return _resolve(scene[EnvironmentTable])


def known_magnetic_field(scene: Scene) -> Vec3:
    """Return the field [T], east, north, up, that an autopilot knows: the model's at home, without the anomaly."""
    return _known_field(scene[EnvironmentTable])
