"""Small oblique view of paths with their shadows on the ground."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from lapwing.studies.report.style import COLOURS, FLOWN

WIDTH, HEIGHT, MARGIN = 240.0, 150.0, 14.0  # [pixel]
POINTS = 160  # largest number of points of a path
SMALLEST = 0.5  # [m] minimum extent of the view, so that a hover does not show noise
AZIMUTH, ELEVATION = np.radians(35.0), np.radians(28.0)  # [rad] direction of the viewer


Point = tuple[float, float]
Stroke = tuple[float, float, float, float]  # x and y of both ends


class PathLine(NamedTuple):
    """A path as points of an SVG polyline."""

    colour: str
    air: str
    ground: str
    drops: tuple[Stroke, ...]  # lines from the path to its shadow
    start: Point
    end: Point


class Picture(NamedTuple):
    """All paths of a flight, and a grid on the ground."""

    width: float
    height: float
    paths: tuple[PathLine, ...]
    grid: tuple[Stroke, ...]


def picture(positions: Sequence[np.ndarray]) -> Picture:
    """Return the picture of paths [m], world, each of shape (n, 3)."""
    shown = [path[np.unique(np.linspace(0, len(path) - 1, POINTS).round().astype(int))] for path in positions]
    points = np.concatenate(shown)
    points = points[np.isfinite(points).all(axis=1)]
    if not len(points):
        points = np.zeros((1, 3))
    low, high = points.min(axis=0), points.max(axis=0)
    floor = min(0.0, float(low[2])) if low[2] < SMALLEST else float(low[2])
    centre = 0.5 * (low + high)
    half = 0.5 * max(float((high - low)[:2].max()), 0.6 * float(high[2] - floor), SMALLEST) * 1.15
    corners = np.array([(centre[0] + a * half, centre[1] + b * half, floor) for a in (-1, 1) for b in (-1, 1)])
    flat = _project(np.concatenate([points, corners]))
    least, most = flat.min(axis=0), flat.max(axis=0)
    scale = float(min((WIDTH - 2 * MARGIN) / (most[0] - least[0]), (HEIGHT - 2 * MARGIN) / (most[1] - least[1])))
    shift = np.array([0.5 * WIDTH, 0.5 * HEIGHT]) - scale * 0.5 * (least + most)

    def to_pixels(positions: np.ndarray) -> np.ndarray:
        return np.round(scale * _project(positions) + shift, 1)

    lines = []
    for k, path in enumerate(shown):
        path = path[np.isfinite(path).all(axis=1)]
        if not len(path):
            continue
        air, ground = to_pixels(path), to_pixels(np.column_stack([path[:, :2], np.full(len(path), floor)]))
        rows = np.linspace(0, len(path) - 1, 12).round().astype(int)
        drops = tuple(_stroke(air[row], ground[row]) for row in rows)
        colour = COLOURS[k % len(COLOURS)] if len(shown) > 1 else FLOWN
        whole = _stroke(air[0], air[-1])
        lines.append(PathLine(colour, _text(air), _text(ground), drops, whole[:2], whole[2:]))
    grid = []
    for share in np.linspace(-1.0, 1.0, 6):
        for line in (((share, -1.0), (share, 1.0)), ((-1.0, share), (1.0, share))):
            ends = to_pixels(np.array([(centre[0] + half * a, centre[1] + half * b, floor) for a, b in line]))
            grid.append(_stroke(ends[0], ends[1]))
    return Picture(WIDTH, HEIGHT, tuple(lines), tuple(grid))


def _project(points: np.ndarray) -> np.ndarray:
    """Return unscaled image coordinates, x to the right and y downwards, shape (n, 2), of points (n, 3)."""
    x, y, z = points.T
    right = np.cos(AZIMUTH) * x + np.sin(AZIMUTH) * y
    away = -np.sin(AZIMUTH) * x + np.cos(AZIMUTH) * y
    return np.column_stack([right, -(np.sin(ELEVATION) * away + np.cos(ELEVATION) * z)])


def _stroke(start: np.ndarray, end: np.ndarray) -> Stroke:
    return float(start[0]), float(start[1]), float(end[0]), float(end[1])


def _text(points: np.ndarray) -> str:
    return " ".join(f"{x:g},{y:g}" for x, y in points)
