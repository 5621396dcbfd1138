"""Grids of heights: bicubic surface, its continuity and bounds, against SciPy's splines."""

import itertools
import math

import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline

from lapwing.dynamics.terrain import over_plane, ray, relief, summit, surface, touch
from lapwing.dynamics.terrain.ray_casting import cast, steepness

SPACING, CORNER = 0.5, (-2.0, -1.5)
HEIGHTS = 0.1 * np.random.default_rng(5).normal(size=(7, 9))
GROUND = relief(grid=HEIGHTS, corner=CORNER, spacing=SPACING)
COLUMNS, ROWS = (CORNER[k] + SPACING * np.arange(n) for k, n in ((0, 9), (1, 7)))


def spline(nodes, values, axis):
    """Return SciPy's Hermite spline with central differences as slopes, one-sided ones at the ends."""
    return CubicHermiteSpline(nodes, values, np.gradient(values, nodes, axis=axis), axis=axis)


def expected(x, y, order=(0, 0)):
    """Return the height of the tensor product of SciPy's splines, or a derivative along x and y."""
    along = spline(COLUMNS, HEIGHTS, 1)(x, order[0])
    return float(spline(ROWS, along, 0)(y, order[1]))


def gradient(ground, x, y):
    normal = surface(ground, x, y)[1]
    return np.array((-normal[0] / normal[2], -normal[1] / normal[2]))


def elastic_force(ground, place):
    depth, normal, wedge = touch(ground, place)
    assert wedge == 1.0
    return max(depth, 0.0) * np.array(normal)


def test_surface_equals_splines_of_scipy():
    home = expected(0.0, 0.0)
    for x, y in np.random.default_rng(6).uniform((-2.0, -1.5), (2.0, 1.5), (200, 2)).tolist():
        assert surface(GROUND, x, y)[0] == pytest.approx(expected(x, y) - home, abs=1e-15)
        assert gradient(GROUND, x, y) == pytest.approx((expected(x, y, (1, 0)), expected(x, y, (0, 1))), abs=1e-14)


def test_surface_contains_samples():
    offset = HEIGHTS[3, 4]
    for (i, y), (j, x) in itertools.product(enumerate(ROWS.tolist()), enumerate(COLUMNS.tolist())):
        assert surface(GROUND, x, y)[0] == pytest.approx(HEIGHTS[i, j] - offset, abs=1e-16)


@pytest.mark.parametrize("shape", [(2, 2), (2, 5), (7, 3)])
def test_plane_is_reproduced_up_to_edge(shape):
    rows, columns = np.mgrid[0 : shape[0], 0 : shape[1]]
    ground = relief(grid=3.0 + 0.25 * columns - 0.125 * rows, corner=(-0.5, -0.25))
    for x, y in np.random.default_rng(7).uniform((-0.5, -0.25), (shape[1] - 1.5, shape[0] - 1.25), (50, 2)).tolist():
        assert surface(ground, x, y)[0] == pytest.approx(0.25 * x - 0.125 * y, abs=1e-15)
        assert gradient(ground, x, y) == pytest.approx((0.25, -0.125), abs=1e-15)


def test_parabolas_are_reproduced_within_outermost_cells():
    """Keys, 1981: the interpolation is exact up to the second power, so its error is of third order."""
    x, y = COLUMNS, ROWS[:, None]
    ground = relief(grid=0.05 * x * x - 0.03 * y * y + 0.04 * x * y, corner=CORNER, spacing=SPACING)
    for u, v in np.random.default_rng(8).uniform((-1.5, -1.0), (1.5, 1.0), (50, 2)).tolist():
        assert surface(ground, u, v)[0] == pytest.approx(0.05 * u * u - 0.03 * v * v + 0.04 * u * v, abs=1e-15)


@pytest.mark.parametrize("axis", [0, 1])
def test_height_gradient_and_force_are_continuous_across_cells(axis):
    """Borders at every sample, at the edge, and one spacing beyond it."""
    nodes, other = ((COLUMNS, ROWS), (ROWS, COLUMNS))[axis]
    borders = np.arange(nodes[0] - 1.0, nodes[-1] + 1.25, SPACING)
    for border, across in itertools.product(
        borders.tolist(), np.linspace(other[0] - 1.5, other[-1] + 1.5, 23).tolist()
    ):
        sides = [(border + shift, across)[:: 1 - 2 * axis] for shift in (-1e-10, 1e-10)]
        (low, high), slopes = [surface(GROUND, *side)[0] for side in sides], [gradient(GROUND, *s) for s in sides]
        assert low == pytest.approx(high, abs=4e-10)
        assert slopes[0] == pytest.approx(slopes[1], abs=1e-8)
        forces = [elastic_force(GROUND, (*side, low - 1e-3)) for side in sides]
        assert forces[0] == pytest.approx(forces[1], abs=1e-9)


def level_off(way, spacing):
    """Return the rise [m] per slope at the edge: the slope decreases linearly to 0 within one spacing."""
    way = min(way, spacing)
    return way - 0.5 * way * way / spacing


@pytest.mark.parametrize("spacing", [0.5, 30.0])
def test_plane_levels_off_outside(spacing):
    rows, columns = spacing * np.mgrid[0:4, 0:5]
    ground = relief(grid=0.5 * columns - 0.25 * rows, corner=(-2.0 * spacing, -spacing), spacing=spacing)
    for right, up in itertools.product((0.0, 0.3, 1.0, 1.7, 40.0), repeat=2):
        x, y = (2.0 + right) * spacing, (2.0 + up) * spacing
        expected = spacing + 0.5 * level_off(right * spacing, spacing)
        expected -= 0.5 * spacing + 0.25 * level_off(up * spacing, spacing)
        assert surface(ground, x, y)[0] == pytest.approx(expected, abs=1e-13)
        slopes = 0.5 * max(0.0, 1.0 - right), -0.25 * max(0.0, 1.0 - up)
        assert gradient(ground, x, y) == pytest.approx(slopes, abs=1e-14)


def test_paraboloid_levels_off_monotonically_at_corner():
    """The product of two slopes at the corner levels off, too; the slopes at the edge are those of its last cells."""
    x, y = COLUMNS, ROWS[:, None]
    ground = relief(grid=0.05 * x * x - 0.03 * y * y + 0.04 * x * y, corner=CORNER, spacing=SPACING)
    edge_x, edge_y = 0.05 * (2.0 + 1.5) + 0.04 * 1.5, -0.03 * (1.5 + 1.0) + 0.04 * 2.0
    corner = 0.05 * 4.0 - 0.03 * 2.25 + 0.04 * 3.0
    for right, up in itertools.product((0.0, 0.1, 0.25, 0.5, 3.0), repeat=2):
        far_x, far_y = level_off(right, SPACING), level_off(up, SPACING)
        expected = corner + edge_x * far_x + edge_y * far_y + 0.04 * far_x * far_y
        assert surface(ground, 2.0 + right, 1.5 + up)[0] == pytest.approx(expected, abs=1e-14)
    for way in np.random.default_rng(10).normal(size=(40, 2)).tolist():
        heights = [surface(GROUND, x, way[1]) for x in np.linspace(2.0, 3.0, 30).tolist()]
        steps = np.diff([height for height, _ in heights])
        assert (steps >= -1e-15).all() or (steps <= 1e-15).all()


def test_surface_is_level_beyond_one_spacing_outside():
    """It is half a spacing of the last two samples' line higher than the edge."""
    end = 1.5 * HEIGHTS[3, 8] - 0.5 * HEIGHTS[3, 7] - HEIGHTS[3, 4]
    for x in (2.5, 3.0, 99.0, 1e300):
        assert surface(GROUND, x, 0.0)[0] == pytest.approx(end, abs=1e-15)
    assert surface(GROUND, 3.0, 3.0)[1] == (-0.0, -0.0, 1.0)
    assert surface(GROUND, 1e300, -1e300)[1] == (-0.0, -0.0, 1.0)


def test_bounds_hold_over_entire_surface():
    """The surface is within the convex hull of its Bezier points; overshoot between samples counts."""
    x, y = np.meshgrid(np.linspace(-3.5, 3.5, 141), np.linspace(-3.0, 3.0, 121))
    places = np.column_stack([x.ravel(), y.ravel()]).tolist()
    heights = np.array([over_plane(GROUND, (u, v, surface(GROUND, u, v)[0])) for u, v in places])
    slopes = np.array([np.hypot(*gradient(GROUND, u, v)) for u, v in places])
    assert heights.max() > HEIGHTS.max() - HEIGHTS[3, 4]
    assert heights.max() <= summit(GROUND) < heights.max() + 0.1
    assert slopes.max() <= steepness(GROUND) < 2.5 * slopes.max()


def test_fold_is_rounded_within_one_spacing():
    """Closed form: s w (2 u^2 - |u|^3) for |u| < 1, the fold itself beyond."""
    ground = relief(grid=np.add.outer(np.zeros(2), 0.3 * np.abs(np.arange(-3.0, 4.0))), corner=(-3.0, -0.5))
    for x in np.linspace(-2.9, 2.9, 59).tolist():
        u = abs(x)
        assert surface(ground, x, 0.2)[0] == pytest.approx(0.3 * (2.0 * u * u - u**3 if u < 1.0 else u), abs=1e-15)


def test_rays_end_on_surface():
    rng = np.random.default_rng(9)
    for x, y in rng.uniform(-2.5, 2.5, (60, 2)).tolist():
        direction = np.array((*rng.normal(0.0, 0.5, 2), -1.0))
        direction = tuple((direction / np.linalg.norm(direction)).tolist())
        for distance in (
            cast(GROUND, (x, y, 2.0), direction, steepness(GROUND), 60.0),
            ray(GROUND, (x, y, 2.0), direction, 60.0),
        ):
            end = [x, y, 2.0] + distance * np.array(direction)
            assert end[2] == pytest.approx(surface(GROUND, *end[:2].tolist())[0], abs=1e-8)
    assert cast(GROUND, (0.0, 0.0, 2.0), (0.0, 0.0, 1.0), steepness(GROUND), 60.0) == math.inf
