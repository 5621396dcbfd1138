"""The true state, for clients that test estimators and log analyses."""

import math
from typing import Any

from lapwing.dynamics.constants import STANDARD_GRAVITY
from lapwing.messages.topics import TRUTH
from lapwing.services.common.mavlink.dialect import mavlink
from lapwing.services.common.mavlink.frames import saturate, swap_world
from lapwing.services.mavlink.telemetry.message_stream import stream
from lapwing.services.mavlink.vehicle_cache import VehicleCache

MILLI_G = 1e-3 * STANDARD_GRAVITY  # [m/s^2]


@stream("HIL_STATE_QUATERNION", 15.0)
def true_state(v: VehicleCache) -> Any:
    """Return the true state; the acceleration is dv/dt in body axes."""
    m, truth = v.truth, v.get(TRUTH)
    if m is None:
        return None
    latitude, longitude, altitude = m.geodetic
    air_speed = saturate(100.0 * math.dist(m.velocity_ned, swap_world(tuple(truth.wind))), 16, unsigned=True)
    acceleration = _to_body(m.attitude, swap_world(tuple(truth.acceleration)))
    return mavlink.MAVLink_hil_state_quaternion_message, (
        v.boot_us,
        list(m.attitude),
        *m.omega_frd,
        saturate(latitude * 1e7, 32),
        saturate(longitude * 1e7, 32),
        saturate(altitude * 1e3, 32),
        *[saturate(u * 1e2, 16) for u in m.velocity_ned],
        air_speed,
        air_speed,
        *[saturate(a / MILLI_G, 16) for a in acceleration],
    )


@stream("WIND_COV", 0.5, 1.0)
def wind(v: VehicleCache) -> Any:
    """Return the velocity of the air at the vehicle, and the altitude above sea level."""
    m, truth = v.truth, v.get(TRUTH)
    if m is None:
        return None
    return mavlink.MAVLink_wind_cov_message(
        v.boot_us, *swap_world(tuple(truth.wind)), 0.0, 0.0, m.geodetic[2], 0.0, 0.0
    )


def _to_body(q: tuple[float, float, float, float], a: tuple[float, float, float]) -> tuple[float, float, float]:
    """Rotate a world vector into body axes."""
    w, x, y, z = q
    # v' = v - 2 u x (w v - u x v) with u the vector part: the inverse rotation
    c = (y * a[2] - z * a[1], z * a[0] - x * a[2], x * a[1] - y * a[0])
    d = (w * a[0] - c[0], w * a[1] - c[1], w * a[2] - c[2])
    return (a[0] - 2.0 * (y * d[2] - z * d[1]), a[1] - 2.0 * (z * d[0] - x * d[2]), a[2] - 2.0 * (x * d[1] - y * d[0]))
