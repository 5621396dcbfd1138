"""Latitude, longitude and angles for telemetry, with the C library's functions.

Their rounding depends on the machine, which is acceptable for messages outside of the run's digest. In Python they take
a tenth of the time of `lapwing.kernels.math`, which used half of the adapter's processor time.
"""

import math
from functools import lru_cache

from lapwing.dynamics.geodesy import FLATTENING, SEMI_MAJOR, Home, geodetic_to_ecef
from lapwing.dynamics.vector import Vec3
from lapwing.kernels import python_function
from lapwing.services.common.mavlink.frames import Quaternion

_E2 = FLATTENING * (2.0 - FLATTENING)  # first eccentricity squared
_SEMI_MINOR = SEMI_MAJOR * (1.0 - FLATTENING)
_EP2 = _E2 / (1.0 - _E2)  # second eccentricity squared
_to_ecef = python_function(geodetic_to_ecef)


def angles(q: Quaternion) -> Vec3:
    """Return roll, pitch, yaw [rad] of a quaternion."""
    w, x, y, z = q
    roll = math.atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    pitch = math.asin(max(-1.0, min(1.0, 2.0 * (w * y - z * x))))
    return roll, pitch, math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


def geodetic(home: Home, position_world: Vec3) -> Vec3:
    """Return latitude [deg], longitude [deg], height [m] of a point of the world frame (theory, eq. (3.6))."""
    (sp, cp, sl, cl), (x, y, z) = _origin(home)
    e, n, u = position_world
    outward = cp * u - sp * n  # away from the Earth's axis
    x, y, z = x - sl * e + cl * outward, y + cl * e + sl * outward, z + cp * n + sp * u
    rho = math.hypot(x, y)
    s, c = z * SEMI_MAJOR, rho * _SEMI_MINOR
    latitude = 0.0
    for _ in range(2):  # Bowring's iteration, see `lapwing.dynamics.geodesy.ecef_to_geodetic`
        length = math.hypot(s, c)
        s, c = s / length, c / length
        latitude = math.atan2(z + _EP2 * _SEMI_MINOR * s * s * s, rho - _E2 * SEMI_MAJOR * c * c * c)
        s, c = (1.0 - FLATTENING) * math.sin(latitude), math.cos(latitude)
    s, c = math.sin(latitude), math.cos(latitude)
    height = rho * c + z * s - SEMI_MAJOR * math.sqrt(1.0 - _E2 * s * s)
    return math.degrees(latitude), math.degrees(math.atan2(y, x)), height


@lru_cache(16)
def _origin(home: Home) -> tuple[tuple[float, float, float, float], Vec3]:
    """Return sine and cosine of latitude and longitude, and Earth-fixed coordinates [m], of a home."""
    latitude, longitude = math.radians(home.latitude_deg), math.radians(home.longitude_deg)
    axes = math.sin(latitude), math.cos(latitude), math.sin(longitude), math.cos(longitude)
    return axes, _to_ecef(home.latitude_deg, home.longitude_deg, home.height)
