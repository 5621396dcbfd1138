"""Inner corners: distance to the nearest point outside, its gradient, and the continuity of the elastic force."""

import itertools
import math

import numpy as np
import pytest

from lapwing.dynamics.terrain import relief, touch

DEEP = 1e-3  # [m] range of depths of the test points
STEP, STAIR = relief(steps=[(1.0, 0.2)]), relief(steps=[(1.0, 0.2), (1.5, 0.3)])
ROOM = relief(boxes=[(2.0, 0.0, 2.0, 9.0, 0.0, 1.0), (0.0, 2.0, 9.0, 2.0, 0.0, 1.0)])
BEND = relief(boxes=[(2.0, 0.0, 2.0, 9.0, 0.0, 1.0), (0.0, 2.0, 9.0, 2.0, 0.5, 1.0)])
UPHILL, DOWNHILL = (relief((a, 0.1), boxes=[(2.0, 0.0, 2.0, 9.0, 0.0, 1.0)]) for a in (0.3, -0.3))
PILLAR = relief(cylinders=[(0.0, 0.0, 1.0, 2.0)])
PLATFORM = relief(boxes=[(0.5, 0.0, 1.0, 1.0, 0.0, 0.2), (1.45, 0.0, 1.0, 1.0, 0.0, 0.2)])
SUNK = relief((0.2, 0.0), boxes=[(1.0, 0.0, 2.0, 2.0, 0.0, 0.2)])
WALL_B = np.array((-math.sin(0.5), math.cos(0.5), 0.0))  # direction into the second box of `BEND`


def bend_corner():
    """Return x and y at which the walls of `BEND` meet: x = 1, and one metre before (0, 2) along the second box."""
    return 1.0, (WALL_B @ (0.0, 2.0, 0.0) - 1.0 - WALL_B[0]) / WALL_B[1]


# terrain, point of the corner, outward normals of its faces with a point on each
CORNERS = {
    "step": (STEP, (1.0, 0.3, 0.0), [(0, 0, 1), (-1, 0, 0)]),
    "tread": (STAIR, (1.5, 0.3, 0.2), [(0, 0, 1), (-1, 0, 0)]),
    "room": (ROOM, (1.0, 1.0, 0.0), [(0, 0, 1), (-1, 0, 0), (0, -1, 0)]),
    "walls": (ROOM, (1.0, 1.0, 0.5), [(-1, 0, 0), (0, -1, 0)]),
    "bend": (BEND, (*bend_corner(), 0.0), [(0, 0, 1), (-1, 0, 0), -WALL_B]),
    "uphill": (UPHILL, (1.0, 0.3, 0.33), [np.array((-0.3, -0.1, 1.0)) / math.sqrt(1.1), (-1, 0, 0)]),
    "downhill": (DOWNHILL, (1.0, 0.3, -0.27), [np.array((0.3, -0.1, 1.0)) / math.sqrt(1.1), (-1, 0, 0)]),
    "pillar": (PILLAR, (0.6, 0.8, 0.0), [(0, 0, 1), (0.6, 0.8, 0)]),
    "sunk": (SUNK, (1.0, 0.3, 0.2), [np.array((-0.2, 0.0, 1.0)) / math.sqrt(1.04), (0, 0, 1)]),
}


def nearest_outside(depths, normals):
    """Return (way to the nearest point outside all faces, sum of the multipliers): active sets by linear algebra."""
    best, multipliers = None, None
    for size in range(1, len(depths) + 1):
        for active in map(list, itertools.combinations(range(len(depths)), size)):
            n = normals[active]
            solution = np.linalg.solve(n @ n.T, depths[active])
            way = solution @ n
            feasible = (normals @ way >= depths - 1e-15).all()
            if feasible and (solution >= 0.0).all() and (best is None or way @ way < best @ best):
                best, multipliers = way, solution.sum()
    return best, multipliers


def points(corner, seed=1, count=400):
    rng = np.random.default_rng(seed)
    return [tuple(map(float, corner + rng.uniform(-DEEP, DEEP, 3))) for _ in range(count)]


@pytest.mark.parametrize(("ground", "corner", "normals"), CORNERS.values(), ids=CORNERS)
def test_depth_is_distance_to_nearest_point_outside(ground, corner, normals):
    """A cylinder is compared with its tangent plane, which is 5e-7 away."""
    normals, corner, met = np.array(normals, dtype=float), np.array(corner), 0
    tolerance = 1e-6 if ground is PILLAR else 1e-13
    for place in points(corner):
        depths = normals @ (corner - place)
        depth, normal, wedge = touch(ground, place)
        if depths.max() <= 0.0:
            assert depth <= tolerance
            continue
        way, multipliers = nearest_outside(depths, normals)
        assert depth == pytest.approx(np.linalg.norm(way), abs=tolerance)
        if depth > 1e-5:
            assert np.array(normal) == pytest.approx(way / depth, abs=2.0 * tolerance / 1e-5)
            assert wedge == pytest.approx(multipliers / depth, abs=4.0 * tolerance / 1e-5)
        met += wedge > 1.0
    assert met > 5


@pytest.mark.parametrize(("ground", "corner", "normals"), CORNERS.values(), ids=CORNERS)
def test_normal_is_gradient_of_depth(ground, corner, normals):
    """The elastic force is then the gradient of a potential; a field's depth is exact on planes only."""
    h = 1e-9
    for place in points(np.array(corner), 2):
        depth, normal, _ = touch(ground, place)
        if depth < 1e-5:
            continue
        shifts = h * np.eye(3)
        slopes = [(touch(ground, (*(place + s),))[0] - touch(ground, (*(place - s),))[0]) / (2.0 * h) for s in shifts]
        assert np.array(normal) == pytest.approx(-np.array(slopes), abs=2e-3)


@pytest.mark.parametrize(("ground", "corner", "normals"), CORNERS.values(), ids=CORNERS)
def test_elastic_force_is_continuous(ground, corner, normals):
    """Projections onto convex sets do not expand: the force changes at most by the stiffness times the distance."""
    rng = np.random.default_rng(3)
    for place in points(np.array(corner), 3):
        other = tuple(map(float, place + rng.normal(scale=1e-7, size=3)))
        first, second = (max(t[0], 0.0) * np.array(t[1]) for t in (touch(ground, place), touch(ground, other)))
        assert np.linalg.norm(first - second) <= np.linalg.norm(np.subtract(place, other)) * (1.0 + 2e-3) + 1e-15


def test_hidden_wall_in_platform_of_two_boxes_does_not_push():
    for x in np.linspace(0.94, 1.02, 41):
        assert touch(PLATFORM, (float(x), 0.1, 0.2 - 1e-4)) == (pytest.approx(1e-4), (-0.0, -0.0, 1.0), 1.0)


def test_nearest_face_counts_at_outer_edge():
    for below, behind in ((1e-4, 2e-4), (2e-4, 1e-4)):
        depth, normal, wedge = touch(STEP, (1.0 + behind, 0.0, 0.2 - below))
        assert depth == pytest.approx(1e-4)
        assert normal == ((-0.0, -0.0, 1.0) if below < behind else (-1.0, 0.0, 0.0))
        assert wedge == 1.0
