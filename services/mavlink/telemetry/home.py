"""Home position, origin and accuracy of the estimate."""

from typing import Any

from lapwing.kernels import math
from lapwing.messages.topics import ESTIMATE
from lapwing.services.common.mavlink.dialect import mavlink
from lapwing.services.common.mavlink.frames import saturate
from lapwing.services.common.mavlink.geo_coordinates import enu_to_geodetic, to_local
from lapwing.services.mavlink.telemetry.message_stream import stream
from lapwing.services.mavlink.vehicle_cache import VehicleCache

# Outputs of the estimator: attitude, velocities, position relative and absolute, height; nothing over terrain.
_OUTPUTS = (
    mavlink.ESTIMATOR_ATTITUDE
    | mavlink.ESTIMATOR_VELOCITY_HORIZ
    | mavlink.ESTIMATOR_VELOCITY_VERT
    | mavlink.ESTIMATOR_POS_HORIZ_REL
    | mavlink.ESTIMATOR_POS_HORIZ_ABS
    | mavlink.ESTIMATOR_POS_VERT_ABS
    | mavlink.ESTIMATOR_PRED_POS_HORIZ_REL
    | mavlink.ESTIMATOR_PRED_POS_HORIZ_ABS
)


@stream("HOME_POSITION", 0.5)
def home_position(v: VehicleCache) -> Any:
    """Return the position of the last arming; before that, the initial position."""
    home = v.home_world
    latitude, longitude, height = enu_to_geodetic(v.description.home, home)
    return mavlink.MAVLink_home_position_message(
        saturate(latitude * 1e7, 32),
        saturate(longitude * 1e7, 32),
        saturate(height * 1e3, 32),
        *to_local(v.description.standing_height, home),
        [math.cos(0.5 * v.home_heading), 0.0, 0.0, math.sin(0.5 * v.home_heading)],
        *(0.0, 0.0, 0.0),
        time_usec=v.boot_us,
    )


@stream("GPS_GLOBAL_ORIGIN")
def global_origin(v: VehicleCache) -> Any:
    """Return the origin of local positions."""
    return mavlink.MAVLink_gps_global_origin_message(*v.origin, time_usec=v.boot_us)


@stream("ESTIMATOR_STATUS", 0.5, 1.0)
def estimator_status(v: VehicleCache) -> Any:
    """Return validity and accuracy of the estimate."""
    e = v.get(ESTIMATE)
    if e is None:
        return None
    spread = math.hypot(e.position_std.x, e.position_std.y)
    return mavlink.MAVLink_estimator_status_message(
        v.boot_us, 0 if e.health_flags else _OUTPUTS, *(0.0,) * 6, spread, e.position_std.z
    )
