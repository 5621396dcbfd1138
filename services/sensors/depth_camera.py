"""Depth camera: distance along the optical axis of each pixel, as an Image of encoding 32FC1 (REP 118)."""

from typing import Annotated, Any, NamedTuple

import numpy as np
from annotated_types import Ge, Gt, Le, Lt

from lapwing.cosim.diagram.tick_schedule import Port
from lapwing.cosim.diagram.topic_encoder import Fields, TopicEncoder
from lapwing.dynamics.noise import Key
from lapwing.dynamics.terrain.ray_casting import as_relief
from lapwing.dynamics.vector import ZERO
from lapwing.kernels import kernel, math
from lapwing.messages import Image, header
from lapwing.messages import topics as topic
from lapwing.messages.cdr_arrays import stamp_columns
from lapwing.services.sensors.scan import READING, ScanPose, ScanState, blank, instrument_pose, scan_distances
from lapwing.services.sensors.sensor_inputs import Place, Truth

__all__ = ["PRESETS", "READING", "DepthCamera", "blank", "initial", "pixels", "sample", "topic_encoders"]

SEES_VEHICLES = True


class DepthCamera(NamedTuple):
    """Parameters of a pinhole camera."""

    width: Annotated[int, Gt(0), Le(640)] = 80  # [pixel] columns of an image
    height: Annotated[int, Gt(0), Le(480)] = 60  # [pixel] rows of an image
    field_of_view_deg: Annotated[float, Gt(0), Lt(179)] = 87.0  # [deg] horizontal
    pitch_deg: Annotated[float, Ge(-90), Le(90)] = 0.0  # [deg] of the axis below body x; 90: down
    position: Place = ZERO  # [m] body
    noise: Annotated[float, Ge(0)] = 0.0  # [m] standard deviation of a distance along a ray
    range_min: Annotated[float, Ge(0)] = 0.0  # [m] along a ray
    range_max: Annotated[float, Gt(0), Le(1e4)] = 100.0  # [m] along a ray
    resolution: Annotated[float, Ge(0)] = 0.0  # [m] step of a reading
    rate: Annotated[float, Gt(0)] = 10.0  # [Hz] images a second


@kernel
def initial(p: DepthCamera, key: Key, truth: Truth) -> ScanState:
    """Return the state before the first image."""
    return ScanState(0)


@kernel
def sample(p: DepthCamera, s: ScanState, key: Key, tick: int, truth: Truth) -> tuple[ScanState, ScanPose]:
    """Return the state and the pose of an image. See `imu.sample` for arguments."""
    return s, instrument_pose(p, truth, tick)


def pixels(p: DepthCamera) -> tuple[np.ndarray, np.ndarray]:
    """Return unit vectors (n, 3), body, row by row from the upper left, and their cosines (n,) with the axis."""
    sine, cosine = math.sincos(0.5 * math.radians(p.field_of_view_deg))
    focal = 0.5 * p.width * cosine / sine  # [pixel]
    down, ahead = math.sincos(math.radians(p.pitch_deg))
    result, along = [], []
    for row in range(p.height):
        for column in range(p.width):
            left, up = 0.5 * p.width - column - 0.5, 0.5 * p.height - row - 0.5
            size = math.sqrt(focal * focal + left * left + up * up)
            result.append(((focal * ahead + up * down) / size, left / size, (up * ahead - focal * down) / size))
            along.append(focal / size)
    return np.array(result), np.array(along)


def topic_encoders(frame: str, port: Port, instrument: Any) -> list[TopicEncoder]:
    """Return the encoder of the sensor's topic."""
    p: DepthCamera = instrument.sensor
    terrain = as_relief(instrument.environment.terrain)
    directions, cosines = pixels(p)

    def depths(x: ScanPose, time_ns: np.ndarray) -> Fields:
        depth = (scan_distances(instrument, terrain, directions, x) * cosines).astype("<f4")
        return {**stamp_columns(time_ns), "data": depth.view(np.uint8)}

    def image() -> Any:
        size = 4 * p.width
        return Image(header(0, frame), p.height, p.width, "32FC1", 0, size, (0,) * (size * p.height))

    return [TopicEncoder(topic.DEPTH_IMAGE, port.name, port.period, depths, image)]


# Intel RealSense D400 series data sheet (337029): 87 x 58 deg at 16:9 (75 x 62 deg at 4:3), errors below 2 % of the
# distance at 2 m (D435) and 4 m (D455), up to 90 Hz. Product pages: 0.3 to 3 m recommended and 10 m at most (D435),
# 0.6 to 6 m and 20 m (D455, as first announced). Depth unit 1 mm. Here 80 x 45 pixels, which is 87 x 56 deg, at 10 Hz;
# the noise is half the stated bound and the same at every distance, whereas that of the cameras grows.
D435 = DepthCamera(height=45, noise=0.02, range_min=0.3, range_max=10.0, resolution=0.001)
D455 = DepthCamera(height=45, noise=0.04, range_min=0.6, range_max=20.0, resolution=0.001)

PRESETS = {"realsense_d435": D435, "realsense_d455": D455, "ideal": DepthCamera()}
