"""Scans of many rays: poses as a port, ray casting in the encoder (theory, eq. (3.52)).

The port has only the poses of the instrument and of the other vehicles of a fleet, so that a scan that is neither
recorded nor subscribed to is not computed.
"""

from typing import Any, NamedTuple

import numpy as np

from lapwing.dynamics.lie.quaternion import NO_ROTATION, Quaternion, rotate
from lapwing.dynamics.noise import Key, normal3
from lapwing.dynamics.terrain.ray_casting import cast, steepness
from lapwing.dynamics.vector import ZERO, Vec3, add
from lapwing.dynamics.vehicles.visible_body import VisibleBody, distance_to_body
from lapwing.kernels import always_inline, kernel, math
from lapwing.kernels.codegen import map_index
from lapwing.services.sensors.sensor_inputs import OtherVehicle, Truth


class VehiclePose(NamedTuple):
    """Pose of another vehicle at a scan."""

    position_world: Vec3 = ZERO  # [m]
    attitude: Quaternion = NO_ROTATION  # body to world


class ScanPose(NamedTuple):
    """Pose of the instrument at a scan, and of the vehicles that it sees."""

    position_world: Vec3 = ZERO  # [m]
    attitude: Quaternion = NO_ROTATION  # of the body
    tick: int = 0  # of the random numbers
    others: tuple[VehiclePose, ...] = ()  # other vehicles of the fleet, in the order of `Instrument.others`


class ScanState(NamedTuple):
    """State of a scanning instrument, unused."""

    tick: int


READING = ScanPose()


def blank() -> ScanState:
    """Return the unused state."""
    return ScanState(0)


@always_inline
def _vehicle_pose(others: tuple[OtherVehicle, ...], i: int) -> VehiclePose:
    return VehiclePose(others[i].position_world, others[i].attitude)


@kernel
def instrument_pose(p: Any, truth: Truth, tick: int) -> ScanPose:
    """Return the pose of an instrument at `p.position` of the body, and those of the other vehicles."""
    others = map_index(_vehicle_pose, truth.others, truth.others)
    return ScanPose(add(truth.position_world, rotate(truth.attitude, p.position)), truth.attitude, tick, others)


@kernel
def _to_vehicles(bodies: np.ndarray, poses: np.ndarray, origin: Vec3, direction: Vec3) -> float:
    result = math.inf
    for i in range(len(bodies)):
        b, x = bodies[i], poses[i]
        distance = distance_to_body(
            VisibleBody(b[0], b[1], b[2], b[3], b[4]), (x[0], x[1], x[2]), Quaternion(x[3], x[4], x[5], x[6]),
            origin, direction,
        )  # fmt: skip
        result = min(result, distance)
    return result


@kernel
def scan(
    terrain: Any, key: Key, noise: float, least: float, most: float, step: float, steep: float, rays: np.ndarray,
    position: np.ndarray, attitude: np.ndarray, tick: int, bodies: np.ndarray, poses: np.ndarray, out: np.ndarray,
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
        bodies: (k, 5) `VisibleBody` of the other vehicles.
        poses: (k, 7) their positions [m], world, and attitudes wxyz, body to world.
        out: (n,) [m].
    """
    origin = (position[0], position[1], position[2])
    q = Quaternion(attitude[0], attitude[1], attitude[2], attitude[3])
    noises = ZERO
    for k in range(len(rays)):
        direction = rotate(q, (rays[k, 0], rays[k, 1], rays[k, 2]))
        distance = cast(terrain, origin, direction, steep, most)
        if len(bodies) > 0:
            distance = min(distance, _to_vehicles(bodies, poses, origin, direction))
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
    position, attitude, ticks = (np.asarray(part, float) for part in x[:3])
    bodies, poses = np.array(instrument.others).reshape(-1, 5), np.empty((len(ticks), len(instrument.others), 7))
    for i in range(len(bodies)):
        poses[:, i, :3], poses[:, i, 3:] = x.others[i]
    result, steep = np.empty((len(ticks), len(rays))), steepness(terrain)
    for row in range(len(ticks)):
        scan(
            terrain, instrument.key, p.noise, p.range_min, p.range_max, p.resolution, steep, rays,
            position[row], attitude[row], int(ticks[row]), bodies, poses[row], result[row],
        )  # fmt: skip
    return result
