"""Scans of lidar and depth camera against an independent ray march, closed forms, and messages of a real run."""

import math

import numpy as np
import pytest

from lapwing.dynamics.terrain import LEVEL, ray, relief
from lapwing.dynamics.terrain.ray_casting import as_relief, cast, steepness
from lapwing.flights.flight_data import FlightData
from lapwing.services.sensors import depth_camera, lidar, scan
from tests.commands import run_command

pytestmark = pytest.mark.usefixtures("uncompiled")

OBSTACLES = relief(
    slope=(0.1, -0.05),
    boxes=[(6.0, 1.0, 2.0, 3.0, 0.7, 2.5), (-5.0, -4.0, 1.0, 1.0, 0.0, 4.0)],
    cylinders=[(0.0, 7.0, 1.5, 3.0)],
)
ALONE = (np.empty((0, 5)), np.empty((0, 7)))  # no other vehicles
BUMPS = relief(bump_height=0.5, bump_length=8.0, boxes=[(6.0, 1.0, 2.0, 3.0, 0.7, 2.5)])


@pytest.mark.parametrize("terrain", [OBSTACLES, BUMPS], ids=["obstacles", "bumps"])
def test_cast_equals_ray_march(terrain):
    """The march misses parts narrower than 2 cm: a few grazing rays may differ."""
    random = np.random.default_rng(1)
    differences = []
    for _ in range(400):
        origin = (*random.uniform(-3.0, 3.0, 2).tolist(), random.uniform(1.5, 4.0))
        d = random.normal(size=3) * (1.0, 1.0, 0.4)
        direction = tuple((d / np.linalg.norm(d)).tolist())
        results, expected = (
            cast(terrain, origin, direction, steepness(terrain), 60.0),
            ray(terrain, origin, direction, 60.0),
        )
        differences.append(0.0 if results == expected else abs(results - expected))
    assert np.quantile(differences, 0.98) < 1e-5


def test_cast_on_level_ground_and_wall():
    level = as_relief(LEVEL)
    assert cast(level, (0.0, 0.0, 2.0), (0.6, 0.0, -0.8), 0.0, 100.0) == pytest.approx(2.5, abs=1e-15)
    assert cast(level, (0.0, 0.0, 2.0), (1.0, 0.0, 0.0), 0.0, 100.0) == math.inf
    assert cast(level, (0.0, 0.0, 2.0), (0.0, 0.0, -1.0), 0.0, 1.9) == math.inf
    wall = relief(boxes=[(5.0, 0.0, 2.0, 8.0, 0.0, 3.0)])
    assert cast(wall, (0.0, 0.0, 2.0), (1.0, 0.0, 0.0), 0.0, 100.0) == pytest.approx(4.0, abs=1e-15)
    assert cast(wall, (0.0, 0.0, 3.1), (1.0, 0.0, 0.0), 0.0, 100.0) == math.inf


def test_rays_cover_circle_once():
    directions = lidar.rays(lidar.Lidar(columns=8, rings=3, elevation_min_deg=-30.0, elevation_max_deg=30.0))
    assert directions.shape == (24, 3)
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1.0, rtol=1e-15)
    assert len(np.unique(directions.round(12), axis=0)) == 24
    np.testing.assert_allclose(directions[:8, 2], -0.5)


def test_depth_of_level_ground_is_height():
    """A camera that points straight down has the same depth in all pixels."""
    p = depth_camera.DepthCamera(width=8, height=6, pitch_deg=90.0)
    directions, cosines = depth_camera.pixels(p)
    out = np.empty(len(directions))
    upright = np.array([1.0, 0.0, 0.0, 0.0])
    scan.scan(
        as_relief(LEVEL), (1, 2), 0.0, 0.0, 50.0, 0.0, 0.0, directions, np.array([1.0, 2.0, 3.0]), upright, 0, *ALONE,
        out,
    )  # fmt: skip
    np.testing.assert_allclose(out * cosines, 3.0, rtol=1e-12)


def test_lidar_presets_have_rays_of_data_sheets():
    """VLP-16: rings 2 degrees apart within 15; RPLIDAR A2M8: 8000 samples a second, 0.45 degrees at 10 Hz."""
    elevations = np.degrees(np.arcsin(lidar.rays(lidar.VLP16)[:: lidar.VLP16.columns, 2]))
    np.testing.assert_allclose(elevations, np.arange(-15.0, 16.0, 2.0), atol=1e-9)
    a2 = lidar.RPLIDAR_A2
    assert a2.columns * a2.rate == 8000.0
    assert np.degrees(np.diff(lidar.azimuths(a2))) == pytest.approx(0.45)
    assert (lidar.VLP16.range_max, a2.range_max) == (100.0, 12.0)


@pytest.mark.parametrize("preset", [depth_camera.D435, depth_camera.D455])
def test_depth_presets_have_view_of_data_sheet(preset):
    """87 x 58 degrees, each to 3 degrees; below 2 % of the distance at 2 and at 4 m."""
    rays, _ = depth_camera.pixels(preset)
    across = 2.0 * np.degrees(np.arctan(np.abs(rays[:, 1] / rays[:, 0]).max()))
    upward = 2.0 * np.degrees(np.arctan(np.abs(rays[:, 2] / rays[:, 0]).max()))
    assert across == pytest.approx(87.0, abs=3.0)
    assert upward == pytest.approx(58.0, abs=3.0)
    assert preset.noise <= 0.02 * {depth_camera.D435: 2.0, depth_camera.D455: 4.0}[preset]


def test_noise_has_stated_deviation_and_repeats():
    out, again = np.empty(3000), np.empty(3000)
    down = np.tile([0.0, 0.0, -1.0], (3000, 1))
    for result in (out, again):
        scan.scan(
            as_relief(LEVEL), (1, 2), 0.03, 0.5, 50.0, 0.0, 0.0, down, np.array([0.0, 0.0, 5.0]),
            np.array([1.0, 0.0, 0.0, 0.0]), 7, *ALONE, result,
        )  # fmt: skip
    np.testing.assert_array_equal(out, again)
    assert out.mean() == pytest.approx(5.0, abs=4 * 0.03 / math.sqrt(3000))
    assert out.std() == pytest.approx(0.03, rel=0.06)


@pytest.mark.long
def test_command_records_scans(tmp_path):
    box = "environment.terrain.box=[{position=[6.0,0.0],size=[2.0,4.0],top=9.0}]"
    values = [
        "sensors.lidar.columns=36", "sensors.lidar.preset=rplidar_a2", "sensors.depth_camera.preset=ideal",
        "sensors.depth_camera.width=8", "sensors.depth_camera.height=6", box, "run.duration=1.0", "success.require=[]",
    ]  # fmt: skip
    log = tmp_path / "scan.mcap"
    sets = [part for text in values for part in ("--set", text)]
    run_command("run", "hover", *sets, "--mode", "single-process", "--log", log, code=0)
    flight = FlightData.read(log)
    ranges = flight.topic("scan").ranges
    assert ranges.shape[1] == 36
    assert ranges[0, 18] == pytest.approx(5.0, abs=0.06)
    depth = np.ascontiguousarray(flight.topic("depth/image_rect").data[0].astype(np.uint8)).view("<f4").reshape(6, 8)
    np.testing.assert_allclose(depth[2, 2:6], 5.0, atol=1e-3)
