"""Messages of PX4's simulator interface that Python writes, and numbers that it shares with compiled code.

Sources: MAVLink common message set; PX4, src/modules/simulation/simulator_mavlink.
"""

from collections.abc import Callable, Sequence
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
    ExternalVisionReading,
    GpsReading,
    ImuReading,
    MagnetometerReading,
    OpticalFlowReading,
    TrueState,
)
from lapwing.services.px4.schema import RC
from lapwing.services.px4.sensor_frame import ACCELEROMETER, GYRO, MAGNETOMETER, TEMPERATURE

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


def second_gps_message(time_us: int, r: GpsReading) -> Any:
    """Return HIL_GPS of a redundant receiver."""
    message = gps_message(time_us, r)
    message.id = 1
    return message


def imu_message(number: int, time_us: int, r: ImuReading) -> Any:
    """Return HIL_SENSOR of a redundant IMU, None without a reading; only that of number 0 sets PX4's clock."""
    if not r.valid:
        return None
    values = *swap_body(r.specific_force_body), *swap_body(r.omega_body), *(0.0,) * 7
    return mavlink.MAVLink_hil_sensor_message(time_us, *values, ACCELEROMETER | GYRO, number)


def second_magnetometer_message(time_us: int, r: MagnetometerReading) -> Any:
    """Return HIL_SENSOR of a redundant magnetometer, None without a reading."""
    if not r.valid:
        return None
    values = *(0.0,) * 6, *(1e4 * x for x in swap_body(r.field_body)), *(0.0,) * 4
    return mavlink.MAVLink_hil_sensor_message(time_us, *values, MAGNETOMETER, 1)


def flow_message(interval: float, time_us: int, r: OpticalFlowReading) -> Any:
    """Return HIL_OPTICAL_FLOW over an `interval` [s]; quality 0 without a reading."""
    if not r.valid:
        return mavlink.MAVLink_hil_optical_flow_message(time_us, 0, round(1e6 * interval), *(0.0,) * 5, 0, 0, 0, -1.0)
    (x, y), (p, q) = ((interval * a, -interval * b) for a, b in (r.flow, r.rate))
    return mavlink.MAVLink_hil_optical_flow_message(
        time_us, 0, round(1e6 * interval), x, y, p, q, 0.0, round(100.0 * TEMPERATURE), 255, 0, r.distance
    )


def vision_message(time_us: int, r: ExternalVisionReading) -> Any:
    """Return ODOMETRY: pose in NED about the world's origin, without velocity; None without a reading."""
    if not r.valid:
        return None
    variances = [0.0] * 21  # rows of the upper triangle
    variances[0] = variances[6] = variances[11] = r.position_variance
    variances[15] = variances[18] = variances[20] = r.attitude_variance
    frames, unknown = (mavlink.MAV_FRAME_LOCAL_NED, mavlink.MAV_FRAME_BODY_FRD), [math.nan] * 6
    pose = *swap_world(r.position_world), list(swap_attitude(r.attitude))
    return mavlink.MAVLink_odometry_message(
        time_us, *frames, *pose, *unknown, variances, [math.nan] * 21, 0, mavlink.MAV_ESTIMATOR_TYPE_VISION, 100
    )


def rc_message(rows: Sequence[Sequence[float]], time_us: int, time: float) -> Any:
    """Return RC_CHANNELS at a `time` [s] with the pulses of the newest row, None before the first one."""
    past = [row[1:] for row in rows if row[0] <= time]
    if not past:
        return None
    pulses = [round(pulse) for pulse in past[-1]] + [UNKNOWN] * (18 - len(past[-1]))
    return mavlink.MAVLink_rc_channels_message(time_us // 1000, len(past[-1]), *pulses, 255)


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


def rare_messages(
    home: Home, flow_interval: float, rc: Sequence[Sequence[float]] = ()
) -> dict[str, Callable[[int, Any], Any]]:
    """Return the messages by port that Python writes; compiled code calls it at ticks with new readings of them.

    Args:
        home: origin of the world.
        flow_interval: [s] between two readings of the optical flow.
        rc: rows of `Px4.rc`.
    """
    distance = dict.fromkeys((ports.RANGEFINDER, ports.SONAR), distance_message)
    return {
        ports.GPS: gps_message,
        **distance,
        ports.OPTICAL_FLOW: partial(flow_message, flow_interval),
        ports.EXTERNAL_VISION: vision_message,
        **{name: partial(imu_message, k + 1) for k, name in enumerate(ports.REDUNDANT[ports.IMU])},
        ports.REDUNDANT[ports.GPS][0]: second_gps_message,
        ports.REDUNDANT[ports.MAGNETOMETER][0]: second_magnetometer_message,
        ports.TRUTH: partial(truth_message, home),
        RC: partial(rc_message, rc),
    }
