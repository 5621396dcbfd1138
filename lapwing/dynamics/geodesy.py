"""Conversions between ENU about a home point and WGS 84.

WGS 84: NIMA TR8350.2. Conversions: theory, eqs. (3.4) to (3.7).
"""

from typing import Annotated, NamedTuple

from annotated_types import Ge, Gt, Le

from lapwing.kernels import always_inline, kernel, math

SEMI_MAJOR = 6378137.0  # [m]
FLATTENING = 1.0 / 298.257223563
_E2 = FLATTENING * (2.0 - FLATTENING)  # first eccentricity squared
_SEMI_MINOR = SEMI_MAJOR * (1.0 - FLATTENING)
_EP2 = _E2 / (1.0 - _E2)  # second eccentricity squared
FLAT = 800.0  # [m] from home, within which the height above the ellipsoid is that above the plane, to 5 cm


class Home(NamedTuple):
    """Origin of the world frame on the WGS 84 ellipsoid."""

    latitude_deg: Annotated[float, Ge(-90.0), Le(90.0)] = 40.7686  # [deg] north; Fisciano, the home of the drone paper
    longitude_deg: Annotated[float, Ge(-180.0), Le(180.0)] = 14.7907  # [deg] east
    height: Annotated[float, Gt(-500.0), Le(9000.0)] = 280.0  # [m] above the ellipsoid; also used as the altitude


@always_inline
def geodetic_to_ecef(latitude_deg, longitude_deg, height):
    """Return the Earth-centred, Earth-fixed coordinates [m] of a point (theory, eq. (3.4))."""
    latitude, longitude = math.radians(latitude_deg), math.radians(longitude_deg)
    s, c = math.sincos(latitude)
    n = SEMI_MAJOR / math.sqrt(1.0 - _E2 * s * s)
    return (
        (n + height) * c * math.cos(longitude),
        (n + height) * c * math.sin(longitude),
        (n * (1.0 - _E2) + height) * s,
    )


@always_inline
def ecef_to_geodetic(r):
    """Return latitude [deg], longitude [deg], height [m] of a point near the Earth's surface (theory, eq. (3.5))."""
    rho = math.hypot(r[0], r[1])
    # Bowring's iteration on the reduced latitude: up to 20 km, the second pass changes less than one rounding.
    tangent_s, tangent_c = r[2] * SEMI_MAJOR, rho * _SEMI_MINOR
    latitude = 0.0
    for _ in range(3):
        length = math.hypot(tangent_s, tangent_c)
        s, c = tangent_s / length, tangent_c / length
        latitude = math.atan2(r[2] + _EP2 * _SEMI_MINOR * s * s * s, rho - _E2 * SEMI_MAJOR * c * c * c)
        s, c = math.sincos(latitude)
        tangent_s, tangent_c = (1.0 - FLATTENING) * s, c
    height = rho * c + r[2] * s - SEMI_MAJOR * math.sqrt(1.0 - _E2 * s * s)
    return math.degrees(latitude), math.degrees(math.atan2(r[1], r[0])), height


@always_inline
def _axes(home):
    latitude, longitude = math.radians(home.latitude_deg), math.radians(home.longitude_deg)
    return math.sincos(latitude) + math.sincos(longitude)


@kernel
def enu_to_geodetic(home, position_world):
    """Return latitude [deg], longitude [deg], height [m] of a point of the world frame (theory, eq. (3.6))."""
    sp, cp, sl, cl = _axes(home)
    e, n, u = position_world
    o = geodetic_to_ecef(home.latitude_deg, home.longitude_deg, home.height)
    outward = cp * u - sp * n  # not on the Earth's axis
    return ecef_to_geodetic((o[0] - sl * e + cl * outward, o[1] + cl * e + sl * outward, o[2] + cp * n + sp * u))


@kernel
def geodetic_to_enu(home, latitude_deg, longitude_deg, height):
    """Return the world-frame position [m] of latitude [deg], longitude [deg], height [m] (eq. (3.7))."""
    sp, cp, sl, cl = _axes(home)
    o = geodetic_to_ecef(home.latitude_deg, home.longitude_deg, home.height)
    r = geodetic_to_ecef(latitude_deg, longitude_deg, height)
    dx, dy, dz = r[0] - o[0], r[1] - o[1], r[2] - o[2]
    outward = cl * dx + sl * dy
    return -sl * dx + cl * dy, cp * dz - sp * outward, sp * dz + cp * outward


@always_inline
def height_above_home(home, position_world):
    """Return the height [m] above the ellipsoid of a point of the world frame, less that of home (theory, eq. (3.72)).

    Within 0.1 m of `enu_to_geodetic` up to 100 km from home and 20 km above it.
    """
    x, y, z = position_world
    square = x * x + y * y
    if square <= FLAT * FLAT:
        return z
    s = math.sin(math.radians(home.latitude_deg))
    flatter = 1.0 - _E2 * s * s
    n = SEMI_MAJOR / math.sqrt(flatter)
    east, north = n + home.height + z, n * (1.0 - _E2) / flatter + home.height + z
    bulge = (x * x / east + y * y / north) * (1.0 - FLAT * FLAT / square)
    return z + bulge / (1.0 + math.sqrt(1.0 + bulge / east))


def normal_gravity(latitude_deg: float) -> float:
    """Return gravity [m/s^2] on the ellipsoid (theory, eq. (2.29)); NIMA TR8350.2, eq. (4-1)."""
    square = math.square(math.sin(math.radians(latitude_deg)))
    return 9.7803253359 * (1.0 + 0.00193185265241 * square) / math.sqrt(1.0 - _E2 * square)
