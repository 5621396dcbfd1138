"""GeoTIFF terrain against conversions by other packages."""

import math
import re

import numpy as np
import pymap3d
import pytest

from lapwing.cosim.scene import SceneError
from lapwing.dynamics.terrain import surface
from lapwing.services.common.schemas.environment_schema import environment
from lapwing.services.scene_resolver import load

rasterio = pytest.importorskip("rasterio")

LATITUDE, LONGITUDE = 47.3, 8.5
HOME = {"latitude_deg": LATITUDE, "longitude_deg": LONGITUDE, "height": 500.0}
PLACES = [(0.0, 0.0), (100.0, 0.0), (0.0, 100.0), (-120.0, 80.0), (150.0, -150.0)]
STEP = 1.0 / 3600.0  # [deg] an arc second


def write(path, heights, crs="EPSG:4326", transform=None, **tags):
    """Write a file whose first row is the northernmost."""
    rows, columns = heights.shape[-2:]
    west, north = LONGITUDE - 0.5 * columns * STEP, LATITUDE + 0.5 * rows * STEP
    transform = transform or rasterio.transform.from_origin(west, north, STEP, STEP)
    bands = 1 if heights.ndim == 2 else len(heights)
    values = {"dtype": heights.dtype, "crs": crs, "transform": transform, "nodata": tags.pop("nodata", None)}
    with rasterio.open(path, "w", "GTiff", width=columns, height=rows, count=bands, **values) as file:
        file.write(heights if heights.ndim == 3 else heights[None])
        for name, value in tags.items():
            setattr(file, name, value)
    return path


def ground(path, **grid):
    table = {"file": str(path), "reach": 200.0, "spacing": 10.0} | grid
    return environment(load("hover", {"environment.home": HOME, "environment.terrain.grid": table})).terrain


def test_geographic_heights_match_pymap3d(tmp_path):
    """Compare a plane in degrees with pymap3d; file rows run from north to south."""
    row, column = np.mgrid[0:40, 0:60]
    north, east = (20 - row - 0.5) * STEP, (column + 0.5 - 30) * STEP
    result = ground(write(tmp_path / "hill.tif", 700.0 + 5e3 * north + 2e3 * east))
    for x, y in PLACES:
        latitude, longitude, _ = pymap3d.enu2geodetic(x, y, 0.0, LATITUDE, LONGITUDE, 500.0)
        expected = 5e3 * (latitude - LATITUDE) + 2e3 * (longitude - LONGITUDE)
        assert surface(result, x, y)[0] == pytest.approx(expected, abs=2e-3)


def test_curved_heights_keep_their_curvature(tmp_path):
    """Compare a paraboloid in degrees with its closed form; linear interpolation would be up to 0.3 m too high."""
    row, column = np.mgrid[0:40, 0:60]
    north, east = 31.0 * (20 - row - 0.5), 21.0 * (column + 0.5 - 30)  # [m] about home
    result = ground(write(tmp_path / "hill.tif", 700.0 + 2e-3 * (north**2 + east**2)))
    for x, y in [*PLACES, (11.0, 13.0), (37.0, -45.0), (-64.0, 71.0)]:
        latitude, longitude, _ = pymap3d.enu2geodetic(x, y, 0.0, LATITUDE, LONGITUDE, 500.0)
        north, east = 31.0 * (latitude - LATITUDE) / STEP, 21.0 * (longitude - LONGITUDE) / STEP
        assert surface(result, x, y)[0] == pytest.approx(2e-3 * (north**2 + east**2), abs=0.02)


def test_projected_heights_turn_by_meridian_convergence(tmp_path):
    """Check a slope along the easting of UTM zone 32, half a degree west of its central meridian."""
    column = np.mgrid[0:80, 0:80][1]
    easting, northing = 462_200.0, 5_238_700.0  # near home, within the file
    transform = rasterio.transform.from_origin(easting - 400.0, northing + 400.0, 10.0, 10.0)
    result = ground(write(tmp_path / "utm.tif", 0.3 * 10.0 * column, "EPSG:32632", transform))
    convergence = math.atan(math.tan(math.radians(LONGITUDE - 9.0)) * math.sin(math.radians(LATITUDE)))
    scale = 0.9996 * (1.0 + 0.5 * (37_800.0 / 6.38e6) ** 2)
    east = (surface(result, 150.0, 0.0)[0] - surface(result, -150.0, 0.0)[0]) / 300.0
    north = (surface(result, 0.0, 150.0)[0] - surface(result, 0.0, -150.0)[0]) / 300.0
    assert math.atan2(north, east) == pytest.approx(-convergence, abs=1e-4)
    assert math.hypot(east, north) == pytest.approx(0.3 * scale, rel=1e-4)


def test_scaled_heights_are_unscaled(tmp_path):
    column = np.mgrid[0:40, 0:60][1].astype("int16")
    plain = ground(write(tmp_path / "plain.tif", column.astype(float)))
    scaled = ground(write(tmp_path / "scaled.tif", 4 * column, scales=(0.25,), offsets=(100.0,)))
    for x, y in PLACES:
        assert surface(scaled, x, y)[0] == pytest.approx(surface(plain, x, y)[0])


FLAT = np.zeros((40, 60))
HOLE = np.where(np.arange(60) == 30, -9999.0, FLAT)


@pytest.mark.parametrize(
    ("written", "grid", "message"),
    [
        ({}, {"reach": None}, "grid.reach: missing; expected distance [m]"),
        ({}, {"reach": 5.0}, "grid.reach: expected at least the spacing of 10 m, got 5"),
        ({}, {"spacing": 0.1}, "grid.spacing: expected at most 1000000 points"),
        ({}, {"corner": [0.0, 0.0]}, "grid.corner: cannot be set with a GeoTIFF"),
        ({}, {"reach": 3000.0}, "expected a file that covers grid.reach about home"),
        ({"heights": HOLE, "nodata": -9999.0}, {}, "has no height at (0, "),
        ({"heights": np.zeros((3, 40, 60))}, {}, "expected one band of heights"),
        ({"crs": None}, {}, "has no coordinate system"),
        ({"units": ("ft",)}, {}, "has heights in 'ft'; expected metres"),
    ],
)
def test_invalid_geotiff_is_rejected(tmp_path, written, grid, message):
    path = write(tmp_path / "hill.tif", written.pop("heights", FLAT), **written)
    with pytest.raises(SceneError, match=re.escape(message)) as error:
        ground(path, **grid)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("content", [None, b"no image"])
def test_file_without_geotiff_is_rejected(tmp_path, content):
    path = tmp_path / "hill.tif"
    if content:
        path.write_bytes(content)
    with pytest.raises(SceneError, match=r"grid.file: .*expected a GeoTIFF of heights") as error:
        ground(path)
    assert "\n" not in str(error.value)


def test_reach_key_is_rejected_for_array_file(tmp_path):
    np.save(tmp_path / "hill.npy", FLAT)
    with pytest.raises(SceneError, match=r"grid.reach: needs a GeoTIFF"):
        ground(tmp_path / "hill.npy", corner=[-20.0, -20.0])
