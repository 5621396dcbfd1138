"""Autopilot parameters that can be changed in flight: meaning, default and bounds.

Names and units are PX4's where the meaning is the same; MAVLink allows 16 characters. Only gains of the cascaded PID
(PID_...) and failsafe actions (FS_...) have Lapwing's own names. Defaults of PID_... come from the scene's gain set.
`[autopilot.parameters]` sets other values, or `autopilot.parameters` names a file of them (parameter_file.py).
"""

import math
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any, NamedTuple

from lapwing.dynamics.config_error import ConfigError

if TYPE_CHECKING:  # keeps pydantic out of service processes
    from lapwing.cosim.scene import Scene

_YAW_MODES = "0 waypoint, 1 home, 2 away from home, 3 along the velocity, 4 waypoint before moving, 5 unchanged"
_RETURNS = (
    "0 home or the nearest rally point, 1 the mission's landing, 2 the mission's landing along the mission or back "
    "along it, 3 the nearest of these"
)
BAROMETER_HEIGHT, GPS_HEIGHT, SONAR_HEIGHT = 0, 1, 2  # EKF2_HGT_REF
HEIGHT_SENSORS = ("barometer", "gps", "sonar")
"""Sensor of each value of EKF2_HGT_REF."""
_HEIGHT_KNOWN = "with a distance sensor or the true state"
_LEVELS = "1 low, 2 critical, 3 nearly empty"
_HEIGHTS = "0 barometer, 1 GPS, 2 distance sensor, above the ground"
NOTHING, HOLD, RETURN, LAND, DESCEND, TERMINATE = 0, 1, 2, 3, 4, 5  # failsafe actions
_AIRMODES = (
    "0 roll, pitch and yaw torques are reduced, 1 thrust rises to keep roll and pitch torques, 2 and that of yaw"
)
_ACTION = "0 warning, 1 hold, 2 return, 3 land, 4 descend (needs no position)"
_TERMINATE = "5 terminate (stops the motors)"


class Parameter(NamedTuple):
    """A numeric autopilot parameter."""

    name: str
    unit: str
    default: float
    least: float
    most: float
    meaning: str
    integer: bool = False  # only integers
    at_start: bool = False  # a change takes effect at the next start

    def allows(self, value: float) -> bool:
        """Return True if the value is valid."""
        return self.least <= value <= self.most and not (self.integer and value != int(value))

    def check(self, value: float) -> None:
        """Raise ConfigError if the value is invalid."""
        if not self.allows(value):
            kind = "a whole number" if self.integer else "a number"
            raise ConfigError(self.name, f"got {value:g}", f"{kind} from {self.least:g} to {self.most:g}")


_FLIGHT = (
    Parameter("MIS_TAKEOFF_ALT", "m", 2.5, 0.5, 100.0, "default take-off height above home"),
    Parameter(
        "MIS_DIST_1WP", "m", 10000.0, -1.0, 1e5, "maximum distance of a mission's first position; 0 or less: no limit"
    ),
    Parameter("MPC_TKO_SPEED", "m/s", 1.5, 0.1, 5.0, "take-off speed"),
    Parameter("MPC_LAND_SPEED", "m/s", 0.7, 0.1, 2.0, "landing speed below MPC_LAND_ALT2"),
    Parameter("MPC_LAND_CRWL", "m/s", 0.3, 0.1, 2.0, f"landing speed below MPC_LAND_ALT3, {_HEIGHT_KNOWN}"),
    Parameter("MPC_LAND_ALT1", "m", 10.0, 0.0, 122.0, "height above home from which a landing slows down"),
    Parameter("MPC_LAND_ALT2", "m", 5.0, 0.0, 122.0, "height above home below which a landing has its slow speed"),
    Parameter(
        "MPC_LAND_ALT3",
        "m",
        1.0,
        0.0,
        122.0,
        "height above home of the slowest descent, and of the final approach of a trajectory",
    ),
    Parameter("MPC_XY_CRUISE", "m/s", 5.0, 0.1, 20.0, "default horizontal speed"),
    Parameter("MPC_XY_VEL_MAX", "m/s", 8.0, 0.1, 20.0, "maximum horizontal speed"),
    Parameter("MPC_Z_VEL_MAX_UP", "m/s", 3.0, 0.1, 8.0, "maximum climb speed"),
    Parameter("MPC_Z_VEL_MAX_DN", "m/s", 1.5, 0.1, 4.0, "maximum descent speed"),
    Parameter("MPC_ACC_HOR", "m/s^2", 2.0, 0.2, 5.0, "maximum acceleration of the setpoint"),
    Parameter("MPC_JERK_AUTO", "m/s^3", 8.0, 1.0, 50.0, "maximum jerk of the setpoint"),
    Parameter("MPC_YAWRAUTO_MAX", "deg/s", 45.0, 5.0, 180.0, "maximum yaw rate of the setpoint"),
    Parameter("MPC_MAN_Y_MAX", "deg/s", 45.0, 0.0, 180.0, "yaw rate at full stick"),
    Parameter("MPC_MAN_TILT_MAX", "deg", 20.0, 1.0, 70.0, "tilt at full stick"),
    Parameter("MC_ACRO_R_MAX", "deg/s", 100.0, 0.0, 1800.0, "roll rate at full stick in acro"),
    Parameter("MC_ACRO_P_MAX", "deg/s", 100.0, 0.0, 1800.0, "pitch rate at full stick in acro"),
    Parameter("MC_ACRO_Y_MAX", "deg/s", 45.0, 0.0, 1800.0, "yaw rate at full stick in acro"),
    Parameter("MPC_YAW_MODE", "", 0, 0, 5, f"heading during a leg: {_YAW_MODES}", True),
    Parameter("MIS_YAW_ERR", "deg", 12.0, 0.0, 90.0, "heading error at which a mission item counts as reached"),
    Parameter("NAV_ACC_RAD", "m", 2.0, 0.05, 200.0, "default acceptance radius of waypoints"),
    Parameter("RTL_RETURN_ALT", "m", 15.0, 1.0, 200.0, "minimum height above home during a return"),
    Parameter("RTL_TYPE", "", 0, 0, 3, f"destination of a return: {_RETURNS}", True),
    Parameter("RTL_DESCEND_ALT", "m", 10.0, 1.0, 200.0, "height above home at which a return waits before it lands"),
    Parameter("RTL_LAND_DELAY", "s", 0.0, -1.0, 300.0, "waiting time of a return before it lands; below 0: forever"),
    Parameter("COM_DISARM_LAND", "s", 2.0, -1.0, 60.0, "time from landing to disarming; 0 or less: never"),
    Parameter(
        "COM_DISARM_PRFLT", "s", 10.0, -1.0, 600.0, "time from arming to disarming without take-off; 0 or less: never"
    ),
)
_FAILSAFES = (
    Parameter("COM_OF_LOSS_T", "s", 1.0, 0.1, 60.0, "time without a setpoint after which offboard control is lost"),
    Parameter("FS_OFFBOARD_ACT", "", HOLD, 0, 4, f"action if offboard control is lost: {_ACTION}", True),
    Parameter(
        "COM_DL_LOSS_T", "s", 10.0, 0.1, 300.0, "time without a heartbeat after which the ground station is lost"
    ),
    Parameter(
        "NAV_DLL_ACT",
        "",
        RETURN,
        0,
        3,
        "action if the ground station is lost: 0 warning, 1 hold, 2 return, 3 land",
        True,
    ),
    Parameter("COM_RC_IN_MODE", "", 1, 0, 6, "sticks over MAVLink: ignored by 0 (radio only) and 4 (disabled)", True),
    Parameter("COM_RC_LOSS_T", "s", 1.0, 0.0, 35.0, "time without stick positions after which manual control is lost"),
    Parameter(
        "NAV_RCL_ACT", "", RETURN, 0, 3, "action if manual control is lost: 0 warning, 1 hold, 2 return, 3 land", True
    ),
    Parameter(
        "COM_RCL_EXCEPT",
        "",
        0,
        0,
        31,
        "sum of the modes that fly on without sticks: 1 mission, 2 other automatic ones, 4 offboard",
        True,
    ),
    Parameter("BAT_LOW_THR", "", 0.15, 0.0, 0.5, "charge below which the battery is low, fraction"),
    Parameter("FS_BAT_LOW_ACT", "", NOTHING, 0, 4, f"action on a low battery: {_ACTION}", True),
    Parameter("BAT_CRIT_THR", "", 0.07, 0.0, 0.5, "charge below which the battery is critical and arming is denied"),
    Parameter("FS_BAT_CRIT_ACT", "", RETURN, 0, 4, f"action on a critical battery: {_ACTION}", True),
    Parameter("BAT_EMERGEN_THR", "", 0.05, 0.0, 0.5, "charge below which the battery is nearly empty"),
    Parameter("FS_BAT_EMER_ACT", "", LAND, 0, 4, f"action on a nearly empty battery: {_ACTION}", True),
    Parameter("FS_MOTOR_ACT", "", LAND, 0, 5, f"action on a motor failure: {_ACTION}, {_TERMINATE}", True),
    Parameter(
        "COM_POS_FS_DELAY",
        "s",
        10.0,
        0.1,
        100.0,
        "time without GPS, or with too uncertain a position, after which the position is lost",
    ),
    Parameter("FS_ESTIMATE_ACT", "", DESCEND, 0, 4, f"action if the position is lost: {_ACTION}", True),
    Parameter("EKF2_HGT_REF", "", GPS_HEIGHT, 0, 2, f"height reference from the start: {_HEIGHTS}", True, True),
    Parameter("SYS_FAILURE_EN", "", 1, 0, 1, "1: failures may be injected", True),
    Parameter("FD_ACT_EN", "", 1, 0, 1, "1: motor failures are detected", True),
    Parameter(
        "CA_FAILURE_MODE", "", 1, 0, 1, "0: a failed motor stays in the allocation, 1: the first one is left out", True
    ),
    Parameter("MC_AIRMODE", "", 1, 0, 2, f"motors at their minimum: {_AIRMODES}", True),
    Parameter("SIM_GPS_USED", "", 16, 0, 50, "satellites of the simulated GPS; below 4 it has no fix", True),
    Parameter("SYS_FAIL_BAT_LVL", "", 2, 1, 3, f"charge that a wrong battery reports: {_LEVELS}", True),
    Parameter("FS_FENCE_ACT", "", RETURN, 0, 5, f"action outside the fence: {_ACTION}, {_TERMINATE}", True),
    Parameter("GF_MAX_HOR_DIST", "m", 0.0, 0.0, 10000.0, "maximum horizontal distance from home; 0: no limit"),
    Parameter("GF_MAX_VER_DIST", "m", 0.0, 0.0, 10000.0, "maximum height above home; 0: no limit"),
)
_LOOPS = {
    "altitude": "PID_Z",
    "pitch_outer": "PID_X",
    "roll_outer": "PID_Y",
    "roll_inner": "PID_ROLL",
    "pitch_inner": "PID_PITCH",
    "yaw": "PID_YAW",
}
_TERMS = "PID"
_UNITS = {"altitude": "N/m", "pitch_outer": "rad/m", "roll_outer": "rad/m"}  # units of P; N/rad for the other loops


_GRIPPER = Parameter("PD_GRIPPER_EN", "", 1, 0, 1, "1: DO_GRIPPER and mission items release the payload", True)


def _equipment(scene: "Scene") -> list[Parameter]:
    """Return the parameters of fitted sensors and of the payload. Without sensors the true state replaces them."""
    sensors = scene.tables("sensors")
    mag, baro, gps = (float(not sensors or name in sensors) for name in ("magnetometer", "barometer", "gps"))
    distance = float(len({"sonar", "rangefinder"} & set(sensors)))
    most = distance or float(not sensors)
    return [
        Parameter("SYS_HAS_MAG", "", mag, 0, mag, "0: arming requires no readings of the magnetometer", True),
        Parameter("SYS_HAS_BARO", "", baro, 0, baro, "0: arming requires no readings of the barometer", True),
        Parameter("SYS_HAS_NUM_DIST", "", distance, 0, most, "0: arming requires no distance readings", True),
        Parameter("SYS_HAS_GPS", "", gps, 0, gps, "0: the autopilot gets no GPS readings, from the start", True, True),
        *([_GRIPPER] if "payload_release" in scene.tables("effects") else ()),
    ]


def table(scene: "Scene") -> dict[str, Parameter]:
    """Return the parameters of a scene with an `[autopilot]` by name, with the scene's defaults.

    Raises:
        ConfigError: the scene sets an unknown parameter or an invalid value.
    """
    return dict(scene.cached(_table))


def _table(scene: "Scene") -> dict[str, Parameter]:
    gains = gain_parameters(scene.section("gains"))
    parameters = {p.name: p for p in (*gains, *_FLIGHT, *_FAILSAFES, *_equipment(scene))}
    for name, value in scene.lookup("autopilot.parameters").items():
        if name not in parameters:
            raise ConfigError.unknown(f"autopilot.parameters.{name}", "parameter", name, parameters)
        try:
            parameters[name].check(value)
        except ConfigError as error:
            raise error.with_prefix("autopilot.parameters") from None
        parameters[name] = parameters[name]._replace(default=float(value))
    return parameters


def apply_commands(table: dict[str, Parameter], commands: Iterable[Any]) -> dict[str, float]:
    """Return the values after the accepted parameter commands among `commands`."""
    values = {p.name: p.default for p in table.values()}
    for command in commands:
        parameter = table.get(command.text) if command.kind == "parameter" else None
        if parameter and command.values and parameter.allows(command.values[0]):
            values[parameter.name] = command.values[0]
    return values


def gain_parameters(gains: Any) -> list[Parameter]:
    """Return the gain parameters, with the numbers of a gain set as defaults."""
    limit = math.degrees(gains.tilt_limit)
    tilt = Parameter("MPC_TILTMAX_AIR", "deg", limit, min(limit, 5.0), 89.0, "maximum tilt about either axis")
    return [tilt, *(_gain(loop, k, getattr(gains, loop)[k]) for loop in _LOOPS for k in range(3))]


def _gain(loop: str, term: int, value: float) -> Parameter:
    reach = 5.0 * value or 100.0
    unit = _UNITS.get(loop, "N/rad") + ("", "/s", " s")[term]
    meaning = f"{_TERMS[term]} of the loop {loop}"
    return Parameter(f"{_LOOPS[loop]}_{_TERMS[term]}", unit, value, min(reach, 0.0), max(reach, 0.0), meaning)


def with_gains(gains: Any, values: dict[str, float]) -> Any:
    """Return the gain set with the gains in `values`, the parameters by name."""
    loops = {loop: tuple(values[f"{stem}_{term}"] for term in _TERMS) for loop, stem in _LOOPS.items()}
    tilt = values["MPC_TILTMAX_AIR"]
    unchanged = tilt == math.degrees(gains.tilt_limit)  # avoids rounding
    return gains._replace(**loops, tilt_limit=gains.tilt_limit if unchanged else math.radians(tilt))
