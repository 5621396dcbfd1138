"""Messages of PX4's simulator interface: units, frames and masks.

Sources: MAVLink common message set; PX4, src/modules/simulation/simulator_mavlink.
"""

import struct
from typing import NamedTuple

from lapwing.kernels import math
from lapwing.services.common.mavlink.frames import saturate, swap_world
from lapwing.services.common.ports import GPS_FLOAT, GPS_RTK, GPS_SBAS, GPS_SINGLE, DistanceReading, GpsReading
from lapwing.services.px4.framing import Layout

HIL_SENSOR = Layout(107, 108, struct.Struct("<Q13fIB"))
HIL_GPS = Layout(113, 124, struct.Struct("<Q3i3H3hH2BBH"))
DISTANCE_SENSOR = Layout(132, 85, struct.Struct("<I3H4B6fB"))
HIL_ACTUATOR_CONTROLS = Layout(93, 47, struct.Struct("<QQ16fB"))
HEARTBEAT = Layout(0, 50, struct.Struct("<I5B"))
COMMAND_LONG = Layout(76, 152, struct.Struct("<7fH3B"))
RECEIVED = (HIL_ACTUATOR_CONTROLS, HEARTBEAT, COMMAND_LONG)

ACCELEROMETER, GYRO, MAGNETOMETER, BAROMETER, AIRSPEED = 0x7, 0x38, 0x1C0, 0x1A00, 0x400  # fields_updated
LOCK_STEP = 1  # flag of HIL_ACTUATOR_CONTROLS
ARMED = 128  # mode of HIL_ACTUATOR_CONTROLS
TEMPERATURE = 25.0  # [degC] of the sensors, which are not modelled
NO_FIX, FIX_3D = 0, 3
FIX_TYPES = {0: FIX_3D, GPS_SINGLE: FIX_3D, GPS_SBAS: 4, GPS_FLOAT: 5, GPS_RTK: 6}  # GPS_FIX_TYPE by kind of fix
SATELLITES = 12  # reported with a fix
UNKNOWN = 65535
DOWN = 25  # MAV_SENSOR_ROTATION_PITCH_270


def gps_values(time_us: int, r: GpsReading) -> tuple:
    """Return the values of HIL_GPS; the height is sent as above sea level. Without a fix only the time is set."""
    if not r.valid:
        return (time_us, 0, 0, 0, UNKNOWN, UNKNOWN, UNKNOWN, 0, 0, 0, UNKNOWN, NO_FIX, 0, 0, 0)
    east, north, up = r.position_variance
    vn, ve, vd = swap_world(r.velocity_world)
    speed = math.hypot(vn, ve)
    course = round(math.degrees(math.atan2(ve, vn)) * 100.0) % 36000
    return (
        time_us,
        saturate(r.latitude_deg * 1e7, 32),
        saturate(r.longitude_deg * 1e7, 32),
        saturate(r.height * 1e3, 32),
        saturate(100.0 * math.sqrt(east + north), 16, True, UNKNOWN),
        saturate(100.0 * math.sqrt(up), 16, True, UNKNOWN),
        saturate(100.0 * speed, 16, True, UNKNOWN),
        saturate(100.0 * vn, 16),
        saturate(100.0 * ve, 16),
        saturate(100.0 * vd, 16),
        course,
        FIX_TYPES[int(r.fix)],
        int(r.visible) or SATELLITES,
        0,
        0,
    )  # fmt: skip


def distance_values(time_us: int, r: DistanceReading) -> tuple:
    """Return the values of DISTANCE_SENSOR of a downward-facing sensor."""
    distance = saturate(100.0 * r.range, 16, True)
    return (time_us // 1000, 0, UNKNOWN, distance, 0, 0, DOWN, 0, *(0.0,) * 6, 0)


class ActuatorControls(NamedTuple):
    """Outputs of PX4."""

    time_us: int  # [us] PX4's clock
    lock_step: bool
    armed: bool
    controls: tuple[float, ...]  # 16, motors 0 to 1; all 0 while disarmed


def actuator_controls(values: tuple) -> ActuatorControls:
    """Return the outputs in the values of HIL_ACTUATOR_CONTROLS."""
    return ActuatorControls(values[0], bool(values[1] & LOCK_STEP), bool(values[18] & ARMED), values[2:18])
