"""Pose and velocity in one message, with the covariance of the estimator."""

import math
from typing import Any

from lapwing.messages.topics import ESTIMATE
from lapwing.services.common.mavlink.dialect import mavlink
from lapwing.services.mavlink.telemetry.message_stream import stream
from lapwing.services.mavlink.vehicle_cache import VehicleCache

_DIAGONAL = (0, 6, 11, 15, 18, 20)  # indices in the upper triangle of a 6 x 6 matrix, row by row
_GOOD, _BAD = 100, -1  # quality [%], -1: failed


def _triangle(*variances: float) -> list[float]:
    """Return the upper triangle of a covariance with known first diagonal entries."""
    covariance = [math.nan] * 21
    for index, variance in zip(_DIAGONAL, variances, strict=False):
        covariance[index] = variance
    return covariance


@stream("ODOMETRY", 0.0, 30.0)
def odometry(v: VehicleCache) -> Any:
    """Return the pose of FRD in NED and the velocity in NED, as in PX4."""
    m, e = v.estimate, v.get(ESTIMATE)
    if m is None:
        return None
    p, u, r = e.position_std, e.velocity_std, e.attitude_std
    return mavlink.MAVLink_odometry_message(
        m.time_ns // 1000,
        mavlink.MAV_FRAME_LOCAL_NED,
        mavlink.MAV_FRAME_LOCAL_NED,
        *m.position_ned,
        list(m.attitude),
        *m.velocity_ned,
        *m.omega_frd,
        _triangle(p.y**2, p.x**2, p.z**2, r.x**2, r.y**2, r.z**2),
        _triangle(u.y**2, u.x**2, u.z**2),
        0,
        mavlink.MAV_ESTIMATOR_TYPE_AUTOPILOT,
        _BAD if e.health_flags else _GOOD,
    )
