"""Import of terrain heights: a NumPy array, or a GeoTIFF resampled to metres east and north of home."""

from pathlib import Path
from typing import Any

import numpy as np

from lapwing.dynamics.config_error import ConfigError
from lapwing.dynamics.geodesy import Home

GEOTIFF = (".tif", ".tiff")
METRES = ("", "m", "metre", "meter")  # accepted units of a band; most files have none
MOST = 1_000_000  # points of a scene's grid


def of_array(key: str, path: Path) -> np.ndarray:
    """Return the array of an .npy file.

    Raises:
        ConfigError: for `key`, if the file has no two-dimensional array of numbers.
    """
    try:
        array = np.load(path, allow_pickle=False)
    except OSError as error:
        raise ConfigError(key, f"{path}: {(error.strerror or 'cannot be read').lower()}") from None
    except (ValueError, EOFError) as error:
        raise ConfigError(key, f"{path}: {error}", "an array of numbers written by numpy.save") from None
    if array.ndim != 2 or array.dtype.kind not in "fiu":
        raise ConfigError(key, f"{path}: {array.ndim} dimensions of {array.dtype}", "two dimensions of numbers")
    return array.astype(float)


def of_geotiff(key: str, path: Path, home: Home, points: int, spacing: float) -> np.ndarray:
    """Return the heights of a GeoTIFF on a square about home by cubic convolution (theory, section 2.9).

    Args:
        key: scene key of the file, for messages.
        path: file with any coordinate system.
        home: centre of the square.
        points: number of points from home to each side.
        spacing: [m] between neighbours.

    Returns:
        [m] rows from south to north, columns from west to east, shape (2 points + 1, 2 points + 1).

    Raises:
        ConfigError: rasterio is missing, or the file has no heights in metres or does not cover the square.
    """
    try:
        import rasterio
        from rasterio.warp import Resampling, reproject
    except ImportError:
        raise ConfigError(key, "rasterio is not installed; pip install lapwing[geotiff]") from None
    side = 2 * points + 1
    east_north = f"+proj=aeqd +lat_0={home.latitude_deg!r} +lon_0={home.longitude_deg!r} +datum=WGS84 +units=m"
    edge = (points + 0.5) * spacing  # a pixel extends half a spacing around its point
    heights = np.full((side, side), np.nan)
    try:
        with rasterio.open(path) as file:
            _check(key, path, file)
            reproject(
                rasterio.band(file, 1),
                heights,
                dst_crs=east_north,
                dst_transform=rasterio.transform.from_origin(-edge, edge, spacing, spacing),
                dst_nodata=np.nan,
                resampling=Resampling.cubic,
                tolerance=0.0,
            )
            heights = heights[::-1] * file.scales[0] + file.offsets[0]
    except rasterio.errors.RasterioError as error:
        raise ConfigError(key, f"{path}: {error}", "a GeoTIFF of heights") from None
    if np.isnan(heights).any():
        row, column = np.argwhere(np.isnan(heights))[0] - points
        where = f"({column * spacing:g}, {row * spacing:g})"
        raise ConfigError(key, f"{path} has no height at {where} m of home", "a file that covers grid.reach about home")
    return heights


def _check(key: str, path: Path, file: Any) -> None:
    if file.count != 1:
        raise ConfigError(key, f"{path} has {file.count} bands", "one band of heights")
    if file.crs is None:
        raise ConfigError(key, f"{path} has no coordinate system", "a georeferenced GeoTIFF")
    if (unit := file.units[0] or "").lower() not in METRES:
        raise ConfigError(key, f"{path} has heights in {unit!r}", "metres")
