"""Messages of PX4's simulator interface that Python writes, and numbers that it shares with compiled code.

Sources: MAVLink common message set; PX4, src/modules/simulation/simulator_mavlink.
"""

from collections.abc import Callable
from functools import partial
from typing import Any

from lapwing.dynamics.constants import STANDARD_GRAVITY
from lapwing.dynamics.geodesy import Home
from lapwing.dynamics.lie import quaternion
from lapwing.kernels import math, python_function
from lapwing.services.common import ports
from lapwing.services.common.mavlink.dialect import mavlink
from lapwing.services.common.mavlink.frames import compass, saturate, swap_attitude, swap_body, swap_world
from lapwing.services.common.mavlink.geo_coordinates import enu_to_geodetic
from lapwing.services.common.ports import (
    GPS_FLOAT,
    GPS_RTK,
    GPS_SBAS,
    GPS_SINGLE,
    DistanceReading,
    GpsReading,
    TrueState,
)

LOCK_STEP = 1  # flag of HIL_ACTUATOR_CONTROLS
ARMED = 128  # mode of HIL_ACTUATOR_CONTROLS
FIX_TYPES = {0: 3, GPS_SINGLE: 3, GPS_SBAS: 4, GPS_FLOAT: 5, GPS_RTK: 6}  # GPS_FIX_TYPE by kind of fix
SATELLITES = 12  # reported with a fix
UNKNOWN = 65535
DOWN = 25  # MAV_SENSOR_ROTATION_PITCH_270
_rotate_back = python_function(quaternion.rotate_back)


def gps_message(time_us: int, r: GpsReading) -> Any:
    """Return HIL_GPS; the height is sent as above sea level. Without a fix only the time is set."""
    if not r.valid:
        return mavlink.MAVLink_hil_gps_message(time_us, 0, 0, 0, 0, UNKNOWN, UNKNOWN, UNKNOWN, 0, 0, 0, UNKNOWN, 0)
    vn, ve, vd = swap_world(r.velocity_world)
    lengths = math.sqrt(r.position_variance[0] + r.position_variance[1]), math.sqrt(r.position_variance[2])
    return mavlink.MAVLink_hil_gps_message(
        time_us,
        FIX_TYPES[int(r.fix)],
        saturate(r.latitude_deg * 1e7, 32),
        saturate(r.longitude_deg * 1e7, 32),
        saturate(r.height * 1e3, 32),
        *(saturate(100.0 * value, 16, True, UNKNOWN) for value in (*lengths, math.hypot(vn, ve))),
        *(saturate(100.0 * value, 16) for value in (vn, ve, vd)),
        compass(math.atan2(ve, vn)),
        int(r.visible) or SATELLITES,
    )


def distance_message(time_us: int, r: DistanceReading) -> Any:
    """Return DISTANCE_SENSOR of a downward-facing sensor, None without a finite distance."""
    if not (r.valid and math.isfinite(r.range)):
        return None
    distance = saturate(100.0 * r.range, 16, True)
    return mavlink.MAVLink_distance_sensor_message(time_us // 1000, 0, UNKNOWN, distance, 0, 0, DOWN, 0)


def truth_message(home: Home, time_us: int, x: TrueState) -> Any:
    """Return HIL_STATE_QUATERNION, the ground truth of PX4's log; the height is sent as above sea level."""
    latitude, longitude, height = enu_to_geodetic(home, x.position_world)
    acceleration = swap_body(_rotate_back(x.attitude, x.acceleration_world))
    return mavlink.MAVLink_hil_state_quaternion_message(
        time_us,
        swap_attitude(x.attitude),
        *swap_body(x.omega_body),
        saturate(latitude * 1e7, 32),
        saturate(longitude * 1e7, 32),
        saturate(height * 1e3, 32),
        *(saturate(100.0 * value, 16) for value in swap_world(x.velocity_world)),
        0,
        0,
        *(saturate(1e3 / STANDARD_GRAVITY * value, 16) for value in acceleration),
    )


def rare_messages(home: Home) -> dict[str, Callable[[int, Any], Any]]:
    """Return the messages by port that Python writes; compiled code calls it at ticks with new readings of them."""
    distance = dict.fromkeys((ports.RANGEFINDER, ports.SONAR), distance_message)
    return {ports.GPS: gps_message, **distance, ports.TRUTH: partial(truth_message, home)}
