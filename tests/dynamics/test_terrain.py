"""Terrain: gradient, nearest face of an obstacle, ray casts, and rejected options."""

import math

import numpy as np
import pytest

from lapwing.dynamics.config_error import ConfigError
from lapwing.dynamics.terrain import LEVEL, over_plane, ray, relief, summit, surface, touch

GRID = {"grid": 0.2 * np.random.default_rng(1).normal(size=(9, 11)), "corner": (-4.0, -5.0), "spacing": 1.0}
SMOOTH = {
    "slope": relief(slope=(0.2, -0.3)),
    "bumps": relief(bump_height=0.05, bump_length=2.0),
    "slope and bumps": relief(slope=(0.1, 0.1), bump_height=0.05, bump_length=2.0),
    "grid": relief(**GRID),
    "grid on a slope": relief(slope=(0.2, 0.0), **GRID),
}
BOX = relief(boxes=[(2.0, 1.0, 2.0, 1.0, 0.5, 0.7)])
STAIR = relief(steps=[(1.0, 0.2), (2.0, 0.2), (3.0, -0.9)], step_heading=math.pi / 2)


@pytest.mark.parametrize("ground", SMOOTH.values(), ids=SMOOTH)
def test_normal_follows_gradient(ground):
    h = 1e-6
    for x, y in np.random.default_rng(2).uniform(-3.4, 3.4, (40, 2)):
        rise = [(surface(ground, x + h * a, y + h * b)[0] - surface(ground, x - h * a, y - h * b)[0]) / (2.0 * h)
                for a, b in ((1.0, 0.0), (0.0, 1.0))]  # fmt: skip
        length = math.hypot(*rise, 1.0)
        height, normal = surface(ground, x, y)
        assert normal == pytest.approx((-rise[0] / length, -rise[1] / length, 1.0 / length), abs=1e-8)
        depth, face, _ = touch(ground, (x, y, height - 0.01))
        assert depth == pytest.approx(0.01 * normal[2])
        assert face == pytest.approx(normal)
        assert over_plane(ground, (x, y, height)) <= summit(ground) + 1e-12


@pytest.mark.parametrize("ground", [*SMOOTH.values(), BOX, STAIR], ids=[*SMOOTH, "box", "stair"])
def test_nan_position_has_no_obstacle(ground):
    nowhere = (math.nan, math.nan, math.nan)
    assert not touch(ground, nowhere)[0] > 0.0
    assert not over_plane(ground, nowhere) <= 0.0


def test_grid_contains_its_points_relative_to_home():
    heights, ground = GRID["grid"], SMOOTH["grid"]
    assert surface(ground, 0.0, 0.0)[0] == 0.0
    for row, column in ((0, 0), (3, 7), (8, 10)):
        assert surface(ground, column - 4.0, row - 5.0)[0] == pytest.approx(heights[row, column] - heights[5, 4])
    assert surface(ground, 99.0, 0.0)[0] == surface(ground, 8.0, 0.0)[0]
    assert surface(ground, 99.0, 99.0)[1] == pytest.approx((0.0, 0.0, 1.0))


def test_nearest_face_of_box_pushes():
    c, s = math.cos(0.5), math.sin(0.5)

    def at(along, across, z):
        return (2.0 + c * along - s * across, 1.0 + s * along + c * across, z)

    cases = {
        at(0.0, 0.0, 0.69): (0.01, (0.0, 0.0, 1.0)),
        at(0.98, 0.1, 0.3): (0.02, (c, s, 0.0)),
        at(-0.97, 0.1, 0.3): (0.03, (-c, -s, 0.0)),
        at(0.2, 0.46, 0.3): (0.04, (-s, c, 0.0)),
        at(0.2, -0.45, 0.3): (0.05, (s, -c, 0.0)),
    }
    for place, (depth, normal) in cases.items():
        result = touch(BOX, place)
        assert result[0] == pytest.approx(depth)
        assert result[1] == pytest.approx(normal)
    assert touch(BOX, at(1.01, 0.0, 0.3))[0] < 0.0
    assert touch(BOX, at(0.0, 0.0, 0.71))[0] < 0.0


def test_cylinder_pushes_out_of_its_wall_and_up():
    pillar = relief(cylinders=[(0.0, 3.0, 0.5, 2.0)])
    depth, normal, _ = touch(pillar, (0.3, 3.4 - 0.01 * 0.8, 1.0))
    assert depth == pytest.approx(0.5 - math.hypot(0.3, 0.392))
    assert normal == pytest.approx((0.3 / math.hypot(0.3, 0.392), 0.392 / math.hypot(0.3, 0.392), 0.0))
    assert touch(pillar, (0.0, 3.0, 1.99))[0] == pytest.approx(0.01)
    assert touch(pillar, (0.0, 3.0, 1.99))[1] == (0.0, 0.0, 1.0)
    assert surface(pillar, 0.0, 3.49)[0] == 2.0
    assert surface(pillar, 0.0, 3.51)[0] == 0.0


def test_stair_up_and_down():
    heights = [surface(STAIR, x, y)[0] for x, y in ((7.0, 0.5), (0.0, 1.5), (-50.0, 2.5), (0.0, 3.5), (0.0, 500.0))]
    assert heights == pytest.approx([0.0, 0.2, 0.4, -0.5, -0.5])
    for place, outward in (((0.0, 1.01, 0.1), -1.0), ((0.0, 2.99, -0.2), 1.0)):
        depth, normal, _ = touch(STAIR, place)
        assert depth == pytest.approx(0.01)
        assert normal == pytest.approx((0.0, outward, 0.0), abs=1e-12)


@pytest.mark.parametrize("ground", [*SMOOTH.values(), BOX, STAIR])
def test_ray_ends_on_ground(ground):
    rng = np.random.default_rng(3)
    for x, y in rng.uniform(-3.0, 3.0, (20, 2)):
        direction = np.array((*rng.normal(0.0, 0.2, 2), -1.0))
        direction = tuple(float(v) for v in direction / np.linalg.norm(direction))
        end = np.array((x, y, 5.0)) + ray(ground, (x, y, 5.0), direction, 100.0) * np.array(direction)
        assert end[2] <= surface(ground, end[0], end[1])[0] + 1e-9
        before = end - 1e-6 * np.array(direction)
        assert before[2] > surface(ground, before[0], before[1])[0]


def test_ray_down_slope_in_closed_form():
    slope = SMOOTH["slope"]
    assert ray(slope, (1.0, 1.0, 4.0), (0.0, 0.0, -1.0), 100.0) == pytest.approx(4.1)
    assert ray(slope, (0.0, 0.0, 2.0), (0.6, 0.0, -0.8), 100.0) == pytest.approx(2.0 / (0.8 + 0.2 * 0.6))
    assert ray(slope, (0.0, 0.0, 2.0), (0.0, 0.0, -1.0), 1.9) == math.inf


def test_empty_terrain_is_level_ground():
    assert relief() is LEVEL
    assert surface(LEVEL, 3.0, 4.0) == (0.0, (0.0, 0.0, 1.0))
    assert touch(LEVEL, (1.0, 2.0, -0.5)) == (0.5, (0.0, 0.0, 1.0), 1.0)


@pytest.mark.parametrize(
    ("table", "text"),
    [
        ({"slope": (0.8, 0.8)}, "slope: ground steeper than 45 degrees, tangent 1.13; expected a tangent of at most 1"),
        ({"bump_height": 1.0}, "bump_height: ground steeper than 45 degrees"),
        ({"grid": np.eye(5) * 3.0, "corner": (-2.0, -2.0)}, "grid.heights: ground steeper than 45 degrees"),
        ({"grid": np.zeros((5, 1))}, "grid.heights: expected at least 2 rows and 2 columns"),
        ({"grid": np.zeros((3, 3)), "corner": (1.0, 0.0)}, "grid.corner: the grid does not contain home: it"),
        ({"steps": [(2.0, 0.1), (1.0, 0.1)]}, "steps.distance: expected growing distances above 0 m, got [2.0, 1.0]"),
    ],
)
def test_invalid_terrain_is_rejected(table, text):
    with pytest.raises(ConfigError) as error:
        relief(**table)
    assert text in str(error.value)
