"""Flight commands: modes, arming, take-off and landing, positions, missions, speed, failures, restart of the link."""

import math
from typing import Any

from lapwing.services.common.failure_types import UNITS, rejection_text, supported_types
from lapwing.services.common.mavlink.dialect import mavlink
from lapwing.services.common.mavlink.frames import swap_yaw
from lapwing.services.common.mavlink.geo_coordinates import to_world
from lapwing.services.mavlink.protocols import handles
from lapwing.services.mavlink.protocols.commands import (
    ACCEPTED,
    DENIED,
    RULES,
    UNSUPPORTED,
    Command,
    DeniedError,
    Outcome,
    Request,
    rule,
)
from lapwing.services.mavlink.session import Session


@handles("SET_MODE")
def set_mode(session: Session, m: Any) -> None:
    """Handle SET_MODE, the deprecated message without acknowledgement."""
    kind = session.vehicle.firmware.mode_kind(m.custom_mode)
    if kind is None:
        session.send_text(f"no flight mode {m.custom_mode}")
    elif session.trusted:
        session.command(kind)


@rule(mavlink.MAV_CMD_DO_SET_MODE)
def do_set_mode(session: Session, c: Command) -> Outcome:
    """Enter a custom flight mode."""
    firmware = session.vehicle.firmware
    if not int(c.params[0]) & mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED:
        session.send_text("flight modes only by their custom numbers")
        return UNSUPPORTED
    kind = firmware.mode_kind(firmware.custom_mode(c.params[1], c.params[2]))
    if kind is None:
        session.send_text(f"no flight mode {c.params[1]:.0f}, {c.params[2]:.0f}")
        return UNSUPPORTED
    return Request(kind)


@rule(mavlink.MAV_CMD_DO_SET_STANDARD_MODE)
def do_set_standard_mode(session: Session, c: Command) -> Outcome:
    """Enter a standard flight mode."""
    kinds = {mode.standard: mode.kind for mode in session.vehicle.firmware.MODES}
    kinds.pop(mavlink.MAV_STANDARD_MODE_NON_STANDARD, None)
    kind = kinds.get(int(c.params[0]))
    return Request(kind) if kind else UNSUPPORTED


SPEED_AIR, SPEED_GROUND, DEFAULT_SPEED = 0, 1, -2.0  # parameters of DO_CHANGE_SPEED; airspeed is not controlled
DEFAULT_ORBIT_SPEED = 1.0  # [m/s]
NOTHING, REBOOT = 0, 1  # action of PREFLIGHT_REBOOT_SHUTDOWN on the autopilot
FORCED = (21196.0, 2989.0)  # PX4's and ArduPilot's parameter to skip the arming checks


@rule(mavlink.MAV_CMD_COMPONENT_ARM_DISARM)
def arm_disarm(session: Session, c: Command) -> Outcome:
    """Arm or disarm the motors."""
    if c.params[0] not in (0.0, 1.0):
        return DENIED
    return Request("arm" if c.params[0] else "disarm", (float(c.params[1] in FORCED),))


@rule(mavlink.MAV_CMD_NAV_TAKEOFF)
def takeoff(session: Session, c: Command) -> Outcome:
    """Take off to an altitude above sea level or home, as in the firmware; NaN: MIS_TAKEOFF_ALT."""
    datum, altitude, frame = session.vehicle.datum, c.altitude, c.frame
    if math.isnan(altitude):
        altitude, frame = session.parameters.value("MIS_TAKEOFF_ALT"), mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT
    elif not session.vehicle.firmware.TAKEOFF_ABOVE_SEA:
        frame = mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT
    _, _, height = to_world(datum, frame, math.nan, math.nan, altitude)
    return Request("takeoff", (height, math.nan))


@rule(mavlink.MAV_CMD_DO_REPOSITION)
def reposition(session: Session, c: Command) -> Outcome:
    """Fly to a position; unspecified coordinates keep their current values. Yaw is a heading [rad]."""
    estimate = session.vehicle.estimate
    target = to_world(session.vehicle.datum, c.frame, c.latitude, c.longitude, c.altitude)
    yaw = swap_yaw(c.params[3])
    if estimate is None or all(map(math.isnan, target)):
        return Request("hold", (yaw,))  # a heading without a position: turn in place
    position = [
        current if math.isnan(requested) else requested
        for current, requested in zip(estimate.position_world, target, strict=True)
    ]
    speed = c.params[0] if c.params[0] > 0.0 else math.nan
    return Request("goto", (*position, yaw, speed))


@rule(mavlink.MAV_CMD_DO_ORBIT)
def orbit(session: Session, c: Command) -> Outcome:
    """Orbit a position, clockwise for a positive radius, as in PX4."""
    radius, speed, behaviour, turns = c.params
    x, y, z = to_world(session.vehicle.datum, c.frame, c.latitude, c.longitude, c.altitude)
    clockwise = math.copysign(1.0, radius) * math.copysign(1.0, speed) > 0.0
    magnitude = DEFAULT_ORBIT_SPEED if math.isnan(speed) else abs(speed)
    return Request("orbit", (x, y, z, abs(radius), -magnitude if clockwise else magnitude, behaviour, turns))


@rule(mavlink.MAV_CMD_DO_SET_ROI_LOCATION, mavlink.MAV_CMD_DO_SET_ROI)
def set_roi(session: Session, c: Command) -> Outcome:
    """Point the nose at a position."""
    if c.number == mavlink.MAV_CMD_DO_SET_ROI and int(c.params[0]) != mavlink.MAV_ROI_LOCATION:
        return Request("roi") if int(c.params[0]) == mavlink.MAV_ROI_NONE else UNSUPPORTED
    x, y, z = to_world(session.vehicle.datum, c.frame, c.latitude, c.longitude, c.altitude)
    return Request("roi", (x, y, z)) if math.isfinite(x) else DENIED


@rule(mavlink.MAV_CMD_DO_SET_HOME)
def set_home(session: Session, c: Command) -> Outcome:
    """Set home to the current position or to another one."""
    if c.params[0] == 1.0:
        return Request("set_home")
    x, y, z = to_world(session.vehicle.datum, c.frame, c.latitude, c.longitude, c.altitude)
    if not math.isfinite(x):
        return DENIED
    return Request("set_home", (x, y, z - session.vehicle.description.standing_height))


@rule(mavlink.MAV_CMD_DO_GRIPPER)
def gripper(session: Session, c: Command) -> Outcome:
    """Release the payload; it cannot be grabbed again."""
    if not session.vehicle.description.gripper:
        session.send_text("DO_GRIPPER: the vehicle has no payload")
        return UNSUPPORTED
    if session.parameters.value("PD_GRIPPER_EN") == 0.0:
        return mavlink.MAV_RESULT_FAILED  # as in PX4
    return Request("gripper", (0.0,)) if c.params[1] == mavlink.GRIPPER_ACTION_RELEASE else UNSUPPORTED


@rule(mavlink.MAV_CMD_DO_CHANGE_ALTITUDE)
def change_altitude(session: Session, c: Command) -> Outcome:
    """Change the altitude at the current position; the second parameter is its frame."""
    _, _, height = to_world(session.vehicle.datum, int(c.params[1]), math.nan, math.nan, c.params[0])
    return Request("goto", (math.nan, math.nan, height))


@rule(mavlink.MAV_CMD_CONDITION_YAW)
def turn(session: Session, c: Command) -> Outcome:
    """Turn in place to a heading [deg], or by an angle in a direction."""
    heading, relative = math.radians(c.params[0]), c.params[3] == 1.0
    if relative:
        estimate = session.vehicle.estimate
        heading = math.copysign(heading, c.params[2]) + (estimate.angles[2] if estimate else math.nan)
    return Request("hold", (swap_yaw(heading),)) if math.isfinite(heading) else DENIED


@rule(mavlink.MAV_CMD_DO_CHANGE_SPEED)
def change_speed(session: Session, c: Command) -> Outcome:
    """Fly at another speed over the ground; -1 leaves it unchanged, -2 restores that of the parameter."""
    if int(c.params[0]) not in (SPEED_AIR, SPEED_GROUND):
        session.send_text("DO_CHANGE_SPEED: only the speed over the ground")
        return UNSUPPORTED
    if c.params[1] == DEFAULT_SPEED:
        return Request("speed", (math.nan,))
    return Request("speed", (c.params[1],)) if c.params[1] >= 0.0 else ACCEPTED


@rule(mavlink.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN)
def reboot(session: Session, c: Command) -> Outcome:
    """Restart the link, only while disarmed, as in PX4. The autopilot continues: its start is that of the run."""
    action = int(c.params[0])
    if action == REBOOT and not session.vehicle.status.armed:
        session.restart()
        return ACCEPTED
    if action == REBOOT:
        raise DeniedError("Reboot denied: disarm first")
    return ACCEPTED if action == NOTHING else DENIED


# commands without a position or a check
RULES |= {
    mavlink.MAV_CMD_NAV_LAND: lambda session, c: Request("land"),
    mavlink.MAV_CMD_NAV_VTOL_LAND: lambda session, c: Request("land"),
    mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH: lambda session, c: Request("return"),
    mavlink.MAV_CMD_NAV_LOITER_UNLIM: lambda session, c: Request("hold"),
    mavlink.MAV_CMD_DO_PAUSE_CONTINUE: lambda session, c: (
        Request("mission", (math.nan,)) if c.params[0] == 1.0 else Request("hold")
    ),
    mavlink.MAV_CMD_DO_SET_ROI_NONE: lambda session, c: Request("roi"),
    mavlink.MAV_CMD_MISSION_START: lambda session, c: Request("mission_start", (c.params[0],)),
    mavlink.MAV_CMD_DO_SET_MISSION_CURRENT: lambda session, c: (
        Request("mission_current", (c.params[0],)) if c.params[0] >= 0.0 else ACCEPTED
    ),
}


_UNITS = {  # by FAILURE_UNIT
    mavlink.FAILURE_UNIT_SENSOR_GYRO: "gyro",
    mavlink.FAILURE_UNIT_SENSOR_ACCEL: "accelerometer",
    mavlink.FAILURE_UNIT_SENSOR_MAG: "magnetometer",
    mavlink.FAILURE_UNIT_SENSOR_BARO: "barometer",
    mavlink.FAILURE_UNIT_SENSOR_GPS: "gps",
    mavlink.FAILURE_UNIT_SENSOR_DISTANCE_SENSOR: "distance_sensor",
    mavlink.FAILURE_UNIT_SENSOR_OPTICAL_FLOW: "optical_flow",
    mavlink.FAILURE_UNIT_SENSOR_AIRSPEED: "airspeed",
    mavlink.FAILURE_UNIT_SYSTEM_BATTERY: "battery",
    mavlink.FAILURE_UNIT_SYSTEM_MOTOR: "motor",
}


@rule(mavlink.MAV_CMD_INJECT_FAILURE)
def inject_failure(session: Session, c: Command) -> Outcome:
    """Inject a failure of a unit, or repair it."""
    unit, kind = _UNITS.get(int(c.params[0])), int(c.params[1])  # kinds have the numbers of FAILURE_TYPE
    if unit is None:
        session.send_text(f"INJECT_FAILURE: unit {c.params[0]:.0f} unsupported")
        return UNSUPPORTED
    if kind not in supported_types(unit):
        session.send_text(f"INJECT_FAILURE: type {kind} unsupported; {rejection_text(unit)}")
        return UNSUPPORTED
    return Request("inject_failure", (UNITS.index(unit), kind, *c.params[2:]))
