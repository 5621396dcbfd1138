"""Scanning lidar: distances along rings of rays, as LaserScan (one ring) or PointCloud2 (several)."""

from typing import Annotated, Any, NamedTuple

import numpy as np
from annotated_types import Ge, Gt, Le

from lapwing.cosim.diagram.tick_schedule import Port
from lapwing.cosim.diagram.topic_encoder import Fields, TopicEncoder
from lapwing.dynamics.config_error import ConfigError
from lapwing.dynamics.noise import Key
from lapwing.dynamics.terrain.ray_casting import as_relief
from lapwing.dynamics.vector import ZERO
from lapwing.kernels import kernel, math
from lapwing.messages import LaserScan, PointCloud2, PointField, header
from lapwing.messages import topics as topic
from lapwing.messages.cdr_arrays import stamp_columns
from lapwing.services.sensors.scan import READING, ScanPose, ScanState, blank, instrument_pose, scan_distances
from lapwing.services.sensors.sensor_inputs import Place, Truth

__all__ = ["PRESETS", "READING", "Lidar", "blank", "check", "initial", "rays", "sample", "topic_encoders"]

MOST_RAYS = 200_000  # of one scan
SEES_VEHICLES = True


class Lidar(NamedTuple):
    """Parameters of a lidar."""

    columns: Annotated[int, Gt(1), Le(20_000)] = 360  # rays of a ring
    rings: Annotated[int, Gt(0), Le(256)] = 1  # rings, one above the other
    azimuth_deg: Annotated[float, Gt(0), Le(360)] = 360.0  # [deg] field of view about body x
    elevation_min_deg: Annotated[float, Ge(-90), Le(90)] = 0.0  # [deg] of the lowest ring over the body's xy plane
    elevation_max_deg: Annotated[float, Ge(-90), Le(90)] = 0.0  # [deg] of the highest ring
    position: Place = ZERO  # [m] body
    noise: Annotated[float, Ge(0)] = 0.0  # [m] standard deviation of a distance
    range_min: Annotated[float, Ge(0)] = 0.0  # [m] smallest measurable distance
    range_max: Annotated[float, Gt(0), Le(1e4)] = 100.0  # [m] largest measurable distance
    resolution: Annotated[float, Ge(0)] = 0.0  # [m] step of a reading
    rate: Annotated[float, Gt(0)] = 10.0  # [Hz] scans a second


def check(p: Lidar) -> None:
    """Raise ConfigError for too many rays, or a lowest ring above the highest."""
    if p.columns * p.rings > MOST_RAYS:
        raise ConfigError("rings", f"got {p.columns} x {p.rings} rays", f"at most {MOST_RAYS} in a scan")
    if p.elevation_min_deg > p.elevation_max_deg:
        raise ConfigError("elevation_min_deg", f"got {p.elevation_min_deg:g}", "at most elevation_max_deg")


@kernel
def initial(p: Lidar, key: Key, truth: Truth) -> ScanState:
    """Return the state before the first scan."""
    return ScanState(0)


@kernel
def sample(p: Lidar, s: ScanState, key: Key, tick: int, truth: Truth) -> tuple[ScanState, ScanPose]:
    """Return the state and the pose of a scan. See `imu.sample` for arguments."""
    return s, instrument_pose(p, truth, tick)


def azimuths(p: Lidar) -> np.ndarray:
    """Return the azimuths [rad] of a ring, counter-clockwise from above, the full circle without its end."""
    half, turn = 0.5 * math.radians(p.azimuth_deg), math.radians(p.azimuth_deg)
    gaps = p.columns if p.azimuth_deg == 360.0 else p.columns - 1
    return np.array([k * turn / gaps - half for k in range(p.columns)])


def rays(p: Lidar) -> np.ndarray:
    """Return the unit vectors (rings * columns, 3), body, ring by ring from the lowest."""
    gaps = max(p.rings - 1, 1)
    rise = p.elevation_max_deg - p.elevation_min_deg
    result = []
    for ring in range(p.rings):
        sine, cosine = math.sincos(math.radians(p.elevation_min_deg + ring * rise / gaps))
        for azimuth in azimuths(p).tolist():
            y, x = math.sincos(azimuth)
            result.append((cosine * x, cosine * y, sine))
    return np.array(result)


def topic_encoders(frame: str, port: Port, instrument: Any) -> list[TopicEncoder]:
    """Return the encoder of the sensor's topic."""
    p: Lidar = instrument.sensor
    terrain, directions = as_relief(instrument.environment.terrain), rays(p)

    def ranges(x: ScanPose, time_ns: np.ndarray) -> Fields:
        return {**stamp_columns(time_ns), "ranges": scan_distances(instrument, terrain, directions, x).astype("<f4")}

    def points(x: ScanPose, time_ns: np.ndarray) -> Fields:
        distance = scan_distances(instrument, terrain, directions, x)
        distance[~np.isfinite(distance)] = np.nan
        xyz = (distance[:, :, None] * directions + np.array(p.position)).astype("<f4")
        return {**stamp_columns(time_ns), "data": xyz.reshape(len(xyz), -1).view(np.uint8)}

    def laser_scan() -> Any:
        angles = azimuths(p)
        return LaserScan(
            header(0, frame), angles[0], angles[-1], angles[1] - angles[0], 0.0, 1.0 / p.rate, p.range_min, p.range_max,
            (0.0,) * p.columns, (),
        )  # fmt: skip

    def point_cloud() -> Any:
        fields = tuple(PointField(name, 4 * k, PointField.FLOAT32, 1) for k, name in enumerate("xyz"))
        size = 12 * p.columns
        return PointCloud2(
            header(0, frame), p.rings, p.columns, fields, False, 12, size, (0,) * (size * p.rings), False
        )

    if p.rings == 1:
        return [TopicEncoder(topic.LASER_SCAN, port.name, port.period, ranges, laser_scan)]
    return [TopicEncoder(topic.POINT_CLOUD, port.name, port.period, points, point_cloud)]


# Velodyne VLP-16 data sheet (63-9229) and manual (63-9243): 16 channels 2 deg apart, +-15 deg, 100 m, typically +-3 cm
# (taken as one deviation), 0.1 to 0.4 deg at 5 to 20 Hz, counts of 2 mm. The least distance is that of the ROS driver's
# maintainers (the sheet has none), and columns of one degree are chosen to save time.
# Slamtec RPLIDAR A2M8 data sheet (rev. 2.5): 12 m (older models 8 m), 8000 samples a second, 0.45 deg at 10 Hz. Least
# distance 0.15 m; resolution 0.5 mm below 1.5 m and 1 % of the distance beyond as printed for the A1M8 (the page of the
# A2M8 was not checked); the noise of 1 cm is chosen.
VLP16 = Lidar(
    rings=16, elevation_min_deg=-15.0, elevation_max_deg=15.0, noise=0.03, range_min=0.5, range_max=100.0,
    resolution=0.002,
)  # fmt: skip
RPLIDAR_A2 = Lidar(columns=800, noise=0.01, range_min=0.15, range_max=12.0, resolution=0.0005)

PRESETS = {"vlp16": VLP16, "rplidar_a2": RPLIDAR_A2, "ideal": Lidar()}
