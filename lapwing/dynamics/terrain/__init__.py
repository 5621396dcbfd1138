"""Terrain: level ground or a relief. The kind is known when a kernel is compiled, so level ground has no cost.

`relief` creates one from a slope, bumps, steps, a grid of heights, boxes and cylinders (theory, section 2.9).
"""

from collections.abc import Sequence

import numpy as np

from lapwing.dynamics.config_error import ConfigError
from lapwing.dynamics.terrain.heightfield import BORDER, Relief, field, ray
from lapwing.dynamics.terrain.terrain_queries import LEVEL, Level, over_plane, summit, surface, touch, upright
from lapwing.kernels import math

FAR = 1e5  # [m] extent of the last step
STEEPEST = 1.0  # tangent of 45 degrees

Box = tuple[float, float, float, float, float, float]  # x, y of the centre, length, width, heading [rad], z of the top
Cylinder = tuple[float, float, float, float]  # x, y of the axis, radius, z of the top


def relief(
    slope: tuple[float, float] = (0.0, 0.0),
    bump_height: float = 0.0,
    bump_length: float = 1.0,
    steps: Sequence[tuple[float, float]] = (),
    step_heading: float = 0.0,
    boxes: Sequence[Box] = (),
    cylinders: Sequence[Cylinder] = (),
    grid: np.ndarray | None = None,
    corner: tuple[float, float] = (0.0, 0.0),
    spacing: float = 1.0,
) -> Level | Relief:
    """Return the combined terrain; level ground without any feature (theory, eq. (2.30)). Lengths in m.

    Args:
        slope: rise along world x and y.
        bump_height: A of bumps A sin(k x) sin(k y).
        bump_length: wavelength 2 pi / k of the bumps.
        steps: (distance from home, rise), with ascending distances above 0.
        step_heading: direction of the steps [rad], 0 along x.
        boxes: boxes on the ground.
        cylinders: upright cylinders on the ground.
        grid: heights relative to home, rows along world y and columns along x.
        corner: world x and y of grid[0, 0].
        spacing: spacing of the grid.

    Raises:
        ConfigError: ground steeper than 45 degrees, a grid without home, steps out of order.
    """
    heights, highest, grid_slope = np.zeros((0, 0)), 0.0, 0.0
    if grid is not None:
        samples = _validate_grid(grid, corner, spacing)
        heights, (highest, grid_slope) = _with_border(samples), _bounds(samples, spacing)
        corner = (corner[0] - BORDER * spacing, corner[1] - BORDER * spacing)
    steep = math.hypot(*slope) + abs(bump_height) * 2.0 * math.pi / bump_length
    if steep > STEEPEST:
        key = "bump_height" if bump_height else "slope"
        raise ConfigError(key, f"ground steeper than 45 degrees, tangent {steep:.2f}", "a tangent of at most 1")
    base, treads = _treads(steps, step_heading)
    rows = [_row(box) for box in boxes] + treads
    plane = [[u * slope[0] + v * slope[1] for u, v in _corners(row)] for row in rows]
    over = [row[7] - min(z) for row, z in zip(rows, plane, strict=True)]
    over += [z - slope[0] * x - slope[1] * y + radius * math.hypot(*slope) for x, y, radius, z in cylinders]
    summit = max([base + bump_height + highest, *over])
    result = Relief(
        (float(slope[0]), float(slope[1])), float(bump_height), 2.0 * math.pi / bump_length, base, heights,
        (float(corner[0]), float(corner[1])), float(spacing), grid_slope,
        np.array(rows, dtype=float).reshape(-1, 8), np.array(cylinders, dtype=float).reshape(-1, 4), float(summit),
    )  # fmt: skip
    if tuple(slope) == (0.0, 0.0) and bump_height == 0.0 and not (heights.size or rows or len(cylinders)):
        return LEVEL
    if heights.size:  # z counts from the ground at home
        home = field(result, 0.0, 0.0)[0]
        result = result._replace(grid=heights - home, summit=max([base + bump_height + highest - home, *over]))
    return result


def _validate_grid(grid: np.ndarray, corner: tuple[float, float], spacing: float) -> np.ndarray:
    heights = np.ascontiguousarray(grid, dtype=float)
    if heights.ndim != 2 or min(heights.shape) < 2:
        raise ConfigError("grid.heights", f"got an array of shape {heights.shape}", "at least 2 rows and 2 columns")
    rows, columns = heights.shape
    if not (0.0 <= -corner[0] <= (columns - 1) * spacing and 0.0 <= -corner[1] <= (rows - 1) * spacing):
        x, y = corner[0] + (columns - 1) * spacing, corner[1] + (rows - 1) * spacing
        reach = f"it reaches from ({corner[0]:g}, {corner[1]:g}) to ({x:g}, {y:g}) m"
        raise ConfigError("grid.corner", f"the grid does not contain home: {reach}", "(0, 0) within it")
    rise = max(abs(np.diff(heights, axis=axis)).max() for axis in (0, 1)) / spacing
    if rise > STEEPEST:
        message = f"ground steeper than 45 degrees, tangent {rise:.2f}"
        raise ConfigError(
            "grid.heights", message, "a tangent of at most 1 between neighbours; steps and boxes are walls"
        )
    return heights


def _with_border(heights: np.ndarray) -> np.ndarray:
    """Return the heights with `BORDER` samples outside, which make the slopes at the edge one-sided differences."""
    return np.pad(np.pad(heights, 1, "reflect", reflect_type="odd"), BORDER - 1, "edge")


def _bounds(heights: np.ndarray, spacing: float) -> tuple[float, float]:
    """Return bounds of the height [m] and the slope of the surface: those of the Bezier points of its cells."""
    points = heights
    for axis in (0, 1):
        samples = np.moveaxis(points, axis, 0)
        slopes = np.gradient(samples, axis=0)
        cells = np.stack((samples - slopes / 3.0, samples, samples + slopes / 3.0), axis=1)
        first, last = samples[:1] - 0.5 * slopes[:1], samples[-1:] + 0.5 * slopes[-1:]  # level ground outside
        points = np.moveaxis(np.concatenate((first, cells.reshape(-1, samples.shape[1]), last)), 0, axis)
    along, across = (3.0 * float(np.abs(np.diff(points, axis=axis)).max()) / spacing for axis in (1, 0))
    return float(points.max()), math.hypot(along, across)


def _row(box: Box) -> list[float]:
    x, y, length, width, heading, z = box
    return [x, y, math.cos(heading), math.sin(heading), -0.5 * length, 0.5 * length, 0.5 * width, z]


def _corners(row: Sequence[float]) -> list[np.ndarray]:
    x, y, c, s, first, last, half_width, _ = row
    ends = [(u, v) for u in (first, last) for v in (-half_width, half_width)]
    return [np.array((x + c * u - s * v, y + s * u + c * v)) for u, v in ends]


def _treads(steps: Sequence[tuple[float, float]], heading: float) -> tuple[float, list[list[float]]]:
    """Return (height of the lowest level, a box for each higher level)."""
    at = [distance for distance, _ in steps]
    if any(later <= earlier for earlier, later in zip([0.0, *at], at, strict=False)):
        raise ConfigError("steps.distance", f"got {at}", "growing distances above 0 m")
    level = [0.0, *np.cumsum([rise for _, rise in steps]).tolist()]
    edge = [-FAR, *at, FAR]
    base, rows = min(level), []
    for i, height in enumerate(level):
        if height <= base:
            continue
        first = next((j + 1 for j in range(i - 1, -1, -1) if level[j] < height), 0)
        last = next((j for j in range(i + 1, len(level)) if level[j] < height), len(level))
        start, stop = edge[first], edge[last]
        c, s = math.cos(heading), math.sin(heading)
        wall = stop if start == -FAR else start  # distances from a point far away would round off
        rows.append([c * wall, s * wall, c, s, start - wall, stop - wall, FAR, height])
    return base, rows


__all__ = ["LEVEL", "Level", "Relief", "over_plane", "ray", "relief", "summit", "surface", "touch", "upright"]
