"""Scans of many rays: pose of the instrument as a port, ray casting in the encoder (theory.md, eq. (3.52)).

The port has only the pose, so that a scan that is neither recorded nor subscribed to is not computed.
"""

from typing import Any, NamedTuple

import numpy as np

from lapwing.dynamics.lie.quaternion import NO_ROTATION, Quaternion, rotate
from lapwing.dynamics.noise import Key, normal3
from lapwing.dynamics.terrain.ray_casting import cast, steepness
from lapwing.dynamics.vector import ZERO, Vec3, add
from lapwing.kernels import kernel, math
from lapwing.services.sensors.sensor_inputs import Truth


class ScanPose(NamedTuple):
    """Pose of the instrument at a scan."""

    position_world: Vec3 = ZERO  # [m]
    attitude: Quaternion = NO_ROTATION  # of the body
    tick: int = 0  # of the random numbers


class ScanState(NamedTuple):
    """State of a scanning instrument, unused."""

    tick: int


READING = ScanPose()


def blank() -> ScanState:
    """Return the unused state."""
    return ScanState(0)


@kernel
def instrument_pose(p: Any, truth: Truth, tick: int) -> ScanPose:
    """Return the pose of an instrument at `p.position` of the body."""
    return ScanPose(add(truth.position_world, rotate(truth.attitude, p.position)), truth.attitude, tick)


@kernel
def scan(
    terrain: Any, key: Key, noise: float, least: float, most: float, step: float, steep: float, rays: np.ndarray,
    position: np.ndarray, attitude: np.ndarray, tick: int, out: np.ndarray,
) -> None:  # fmt: skip
    """Write the measured distances of one scan.

    Args:
        terrain: `Relief`.
        key: key of the instrument's random stream.
        noise: [m] standard deviation.
        least: [m] minimum range; nearer distances are -inf.
        most: [m] maximum range; farther distances are inf.
        step: [m] resolution; 0: none.
        steep: `steepness` of the terrain.
        rays: (n, 3) unit vectors, body.
        position: (3,) [m] of the instrument, world.
        attitude: (4,) wxyz, body to world.
        tick: of the random numbers.
        out: (n,) [m].
    """
    origin = (position[0], position[1], position[2])
    q = Quaternion(attitude[0], attitude[1], attitude[2], attitude[3])
    noises = ZERO
    for k in range(len(rays)):
        distance = cast(terrain, origin, rotate(q, (rays[k, 0], rays[k, 1], rays[k, 2])), steep, most)
        if noise > 0.0:
            if k % 3 == 0:
                noises = normal3(key, tick, k // 3)
            distance += noise * noises[k % 3]
        if step > 0.0 and distance < math.inf:
            distance = step * np.floor(distance / step + 0.5)
        out[k] = math.inf if distance > most else -math.inf if distance < least else distance


def scan_distances(instrument: Any, terrain: Any, rays: np.ndarray, x: ScanPose) -> np.ndarray:
    """Return the distances (m, n) [m] of m scans of n rays."""
    p = instrument.sensor
    position, attitude, ticks = (np.asarray(part, float) for part in x)
    result, steep = np.empty((len(ticks), len(rays))), steepness(terrain)
    for row in range(len(ticks)):
        scan(
            terrain, instrument.key, p.noise, p.range_min, p.range_max, p.resolution, steep, rays,
            position[row], attitude[row], int(ticks[row]), result[row],
        )  # fmt: skip
    return result
