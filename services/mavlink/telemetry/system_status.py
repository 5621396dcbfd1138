"""Mode, health and clocks of the vehicle."""

import math
import time
from collections.abc import Iterator
from typing import Any

from lapwing.messages.topics import ESTIMATE
from lapwing.services.common.mavlink.dialect import mavlink
from lapwing.services.mavlink.px4_facts import TYPE, vehicle_type
from lapwing.services.mavlink.telemetry.external_sensors import good_airspeed, good_distance, good_flow
from lapwing.services.mavlink.telemetry.message_stream import stream
from lapwing.services.mavlink.telemetry.power import power
from lapwing.services.mavlink.telemetry.sensors import good_baro, good_gps, good_imu, good_mag
from lapwing.services.mavlink.vehicle_cache import VehicleCache

NONE = 0xFFFF  # no item of a mission
MANUAL = ("position_control", "altitude_control", "stabilized", "acro")  # modes flown with the sticks
CRITICAL = 2  # Status.battery_warning

_CONTROL = (
    mavlink.MAV_SYS_STATUS_SENSOR_ANGULAR_RATE_CONTROL
    | mavlink.MAV_SYS_STATUS_SENSOR_ATTITUDE_STABILIZATION
    | mavlink.MAV_SYS_STATUS_SENSOR_YAW_POSITION
    | mavlink.MAV_SYS_STATUS_SENSOR_Z_ALTITUDE_CONTROL
    | mavlink.MAV_SYS_STATUS_SENSOR_XY_POSITION_CONTROL
    | mavlink.MAV_SYS_STATUS_SENSOR_MOTOR_OUTPUTS
    | mavlink.MAV_SYS_STATUS_LOGGING
)
_SENSORS = {  # validity check, and name of the source in the estimator
    mavlink.MAV_SYS_STATUS_SENSOR_3D_GYRO | mavlink.MAV_SYS_STATUS_SENSOR_3D_ACCEL: (good_imu, "imu"),
    mavlink.MAV_SYS_STATUS_SENSOR_3D_MAG: (good_mag, "magnetometer"),
    mavlink.MAV_SYS_STATUS_SENSOR_ABSOLUTE_PRESSURE: (good_baro, "barometer"),
    mavlink.MAV_SYS_STATUS_SENSOR_GPS: (good_gps, "gps"),
}
_OPTIONAL = {  # by sensor; reported only if one of the sensors is fitted
    ("sonar", "rangefinder"): (mavlink.MAV_SYS_STATUS_SENSOR_LASER_POSITION, good_distance, "sonar"),  # any distance
    ("optical_flow",): (mavlink.MAV_SYS_STATUS_SENSOR_OPTICAL_FLOW, good_flow, "optical_flow"),
    ("airspeed",): (mavlink.MAV_SYS_STATUS_SENSOR_DIFFERENTIAL_PRESSURE, good_airspeed, "airspeed"),
}


_TRANSITIONS = {  # landed state between ground and air, by mode or mission item
    "takeoff": mavlink.MAV_LANDED_STATE_TAKEOFF,
    mavlink.MAV_CMD_NAV_TAKEOFF: mavlink.MAV_LANDED_STATE_TAKEOFF,
    mavlink.MAV_CMD_NAV_VTOL_TAKEOFF: mavlink.MAV_LANDED_STATE_TAKEOFF,
    "land": mavlink.MAV_LANDED_STATE_LANDING,
    "descend": mavlink.MAV_LANDED_STATE_LANDING,
    mavlink.MAV_CMD_NAV_LAND: mavlink.MAV_LANDED_STATE_LANDING,
    mavlink.MAV_CMD_NAV_VTOL_LAND: mavlink.MAV_LANDED_STATE_LANDING,
}


@stream("HEARTBEAT", 1.0)
def heartbeat(v: VehicleCache) -> Any:
    """Return the heartbeat with the current mode."""
    s = v.status
    base = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED | mavlink.MAV_MODE_FLAG_STABILIZE_ENABLED
    if s.armed:
        base |= mavlink.MAV_MODE_FLAG_SAFETY_ARMED
    if s.mode in MANUAL:
        base |= mavlink.MAV_MODE_FLAG_MANUAL_INPUT_ENABLED
    else:
        base |= mavlink.MAV_MODE_FLAG_GUIDED_ENABLED | mavlink.MAV_MODE_FLAG_AUTO_ENABLED
    state = mavlink.MAV_STATE_ACTIVE if s.armed else mavlink.MAV_STATE_STANDBY
    if v.get(ESTIMATE) is None:
        state = mavlink.MAV_STATE_BOOT
    if s.failsafe:
        state = mavlink.MAV_STATE_CRITICAL if s.armed else mavlink.MAV_STATE_FLIGHT_TERMINATION
    set_type = v.parameter(TYPE)  # NaN: not a parameter of this firmware
    kind = vehicle_type(len(v.description.rotors)) if math.isnan(set_type) else int(set_type)
    return mavlink.MAVLink_heartbeat_message(kind, v.firmware.AUTOPILOT, base, v.firmware.mode_number(s.mode), state, 3)


def healthy(v: VehicleCache) -> bool:
    """Return True if the estimate is valid."""
    e = v.get(ESTIMATE)
    return e is not None and e.health_flags == 0


def _is_rejected(v: VehicleCache, source: str) -> bool:
    """Return True if the estimator rejected the newest reading of a sensor or has received none."""
    e = v.get(ESTIMATE)
    return e is not None and source in e.rejected_sources


def sensor_health(v: VehicleCache) -> Iterator[tuple[str, int, bool]]:
    """Yield name, SYS_STATUS bits and validity of each sensor, or of the true state in its place."""
    for bits, (good, source) in _SENSORS.items():
        yield source, bits, good(v) and not _is_rejected(v, source) if v.description.sensors else healthy(v)
    for sensors, (bit, good, source) in _OPTIONAL.items():
        if set(sensors) & set(v.description.sensors):
            yield source, bit, good(v) and not _is_rejected(v, source)


@stream("SYS_STATUS", 1.0, 5.0)
def sys_status(v: VehicleCache) -> Any:
    """Return presence and health of the sensors, arming permission, and battery."""
    present = _CONTROL | mavlink.MAV_SYS_STATUS_AHRS | mavlink.MAV_SYS_STATUS_PREARM_CHECK
    present |= mavlink.MAV_SYS_STATUS_SENSOR_BATTERY
    health = _CONTROL | mavlink.MAV_SYS_STATUS_GEOFENCE
    health |= mavlink.MAV_SYS_STATUS_SENSOR_BATTERY if v.status.battery_warning < CRITICAL else 0
    health &= ~mavlink.MAV_SYS_STATUS_SENSOR_MOTOR_OUTPUTS if v.status.failed_motor else health
    for _, bits, good in sensor_health(v):
        present |= bits
        health |= bits if good else 0
    health |= mavlink.MAV_SYS_STATUS_AHRS if healthy(v) else 0
    health |= 0 if v.status.arming_blockers else mavlink.MAV_SYS_STATUS_PREARM_CHECK
    return mavlink.MAVLink_sys_status_message(present, present, health, 0, *power(v), *(0,) * 6)


@stream("EXTENDED_SYS_STATE", 1.0, 5.0)
def extended_state(v: VehicleCache) -> Any:
    """Return the landed state: on the ground, in the air, taking off or landing."""
    s = v.status
    if s.landed:
        state = mavlink.MAV_LANDED_STATE_ON_GROUND
    else:
        items = v.mission() if s.mode == "mission" else ()
        activity = items[s.mission_current].command if s.mission_current < len(items) else s.mode
        state = _TRANSITIONS.get(activity, mavlink.MAV_LANDED_STATE_IN_AIR)
    return mavlink.MAVLink_extended_sys_state_message(mavlink.MAV_VTOL_STATE_UNDEFINED, state)


@stream("MISSION_CURRENT", 1.0)
def mission_current(v: VehicleCache) -> Any:
    """Return the progress of the mission."""
    s = v.status
    item = 0 if s.mission_current == NONE else s.mission_current
    flying = 1 if s.mode == "mission" else 2
    return mavlink.MAVLink_mission_current_message(item, s.mission_count, s.mission_state, flying)


@stream("SYSTEM_TIME", 1.0)
def system_time(v: VehicleCache) -> Any:
    """Return the time of day and the time since the start."""
    return mavlink.MAVLink_system_time_message(time.time_ns() // 1000, v.boot_ms)


@stream("TIMESYNC", 10.0)
def timesync(v: VehicleCache) -> Any:
    """Return a request of the endpoint's clock."""
    return mavlink.MAVLink_timesync_message(0, v.time_ns)


@stream("EKF_STATUS_REPORT")
def ekf_status(v: VehicleCache) -> Any:
    """Return ArduPilot's status of a valid estimate."""
    # attitude, velocities, absolute and relative positions: bits 0 to 5 and 8, 9 of EKF_STATUS_FLAGS
    return mavlink.MAVLink_ekf_status_report_message(0x33F if healthy(v) else 0, *(0.0,) * 5)
