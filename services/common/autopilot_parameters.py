"""The autopilot's parameters that can be changed in flight: what each means, its default and its bounds.

Names are PX4's where the meaning is the same, and then so is the unit (degrees for angles); at most 16 characters, as
MAVLink wants. Names of our own are those of the controllers' gains (PID_...) and of the failsafes' actions (FS_...).
The defaults of the gains are those of the scene's gain set; `[autopilot.parameters]` of a scene sets others, or
`parameters` in its `[autopilot]` names a file of them (parameter_file.py).
"""

import math
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any, NamedTuple

from lapwing.dynamics.config_error import ConfigError

if TYPE_CHECKING:  # a process that flies has no need of pydantic
    from lapwing.cosim.scene import Scene

_YAW_MODES = "0 to the waypoint, 1 home, 2 away from home, 3 along the flight, 4 to the waypoint before moving, 5 stays"
_RETURNS = (
    "0 home or the nearest rally point, 1 to the mission's landing, 2 there along the mission, else back along it, "
    "3 to the nearest of these"
)
BAROMETER_HEIGHT, GPS_HEIGHT, SONAR_HEIGHT = 0, 1, 2  # EKF2_HGT_REF
HEIGHT_SENSORS = ("barometer", "gps", "sonar")
"""The sensor that each value of EKF2_HGT_REF stands for."""
_LEVELS = "1 a low charge, 2 a critical one, 3 an almost empty pack"
_HEIGHTS = "0 barometer, 1 GPS, 2 distance sensor, above the ground"
NOTHING, HOLD, RETURN, LAND, DESCEND = 0, 1, 2, 3, 4  # what a failsafe does
_ACTION = "0 a warning, 1 hold, 2 return, 3 land, 4 descend, which needs no position"


class Parameter(NamedTuple):
    """One number that the autopilot can be told."""

    name: str
    unit: str
    default: float
    least: float
    most: float
    meaning: str
    whole: bool = False  # only whole numbers
    at_start: bool = False  # a change acts from the next start on

    def allows(self, value: float) -> bool:
        """Whether it can have this value."""
        return self.least <= value <= self.most and not (self.whole and value != int(value))

    def check(self, value: float) -> None:
        """KeyedError if it cannot have this value."""
        if not self.allows(value):
            kind = "a whole number" if self.whole else "a number"
            raise ConfigError(self.name, f"got {value:g}", f"{kind} from {self.least:g} to {self.most:g}")


_FLIGHT = (
    Parameter("MIS_TAKEOFF_ALT", "m", 2.5, 0.5, 100.0, "height above home of a take-off that names none"),
    Parameter("MPC_TKO_SPEED", "m/s", 1.5, 0.1, 5.0, "speed of taking off"),
    Parameter("MPC_LAND_SPEED", "m/s", 0.7, 0.1, 2.0, "speed of the last metres of landing"),
    Parameter("MPC_XY_CRUISE", "m/s", 5.0, 0.1, 20.0, "horizontal speed where none is asked for"),
    Parameter("MPC_XY_VEL_MAX", "m/s", 8.0, 0.1, 20.0, "maximum horizontal speed"),
    Parameter("MPC_Z_VEL_MAX_UP", "m/s", 3.0, 0.1, 8.0, "maximum speed of climbing"),
    Parameter("MPC_Z_VEL_MAX_DN", "m/s", 1.5, 0.1, 4.0, "maximum speed of sinking"),
    Parameter("MPC_ACC_HOR", "m/s^2", 2.0, 0.2, 5.0, "maximum acceleration of the setpoint"),
    Parameter("MPC_JERK_AUTO", "m/s^3", 8.0, 1.0, 50.0, "maximum jerk of the setpoint"),
    Parameter("MPC_YAWRAUTO_MAX", "deg/s", 45.0, 5.0, 180.0, "maximum yaw rate of the setpoint"),
    Parameter("MPC_MAN_Y_MAX", "deg/s", 45.0, 0.0, 180.0, "yaw rate at full stick"),
    Parameter("MPC_MAN_TILT_MAX", "deg", 20.0, 1.0, 70.0, "tilt at full stick"),
    Parameter("MC_ACRO_R_MAX", "deg/s", 100.0, 0.0, 1800.0, "roll rate at full stick in acro"),
    Parameter("MC_ACRO_P_MAX", "deg/s", 100.0, 0.0, 1800.0, "pitch rate at full stick in acro"),
    Parameter("MC_ACRO_Y_MAX", "deg/s", 45.0, 0.0, 1800.0, "yaw rate at full stick in acro"),
    Parameter("MPC_YAW_MODE", "", 0, 0, 5, f"where the nose points on the way: {_YAW_MODES}", True),
    Parameter("MIS_YAW_ERR", "deg", 12.0, 0.0, 90.0, "error within which an item's heading is reached"),
    Parameter("NAV_ACC_RAD", "m", 2.0, 0.05, 200.0, "a waypoint that names no radius is reached within this"),
    Parameter(
        "RTL_RETURN_ALT", "m", 15.0, 1.0, 200.0, "height above home of the way there; a vehicle that is higher stays so"
    ),
    Parameter("RTL_TYPE", "", 0, 0, 3, f"where a return leads: {_RETURNS}", True),
    Parameter("RTL_DESCEND_ALT", "m", 10.0, 1.0, 200.0, "height above home where a return waits before it lands"),
    Parameter("RTL_LAND_DELAY", "s", 0.0, -1.0, 300.0, "time that it waits there; below 0: it stays"),
    Parameter("COM_DISARM_LAND", "s", 2.0, -1.0, 60.0, "after landing the motors are disarmed; not above 0: never"),
    Parameter("COM_DISARM_PRFLT", "s", 10.0, -1.0, 600.0, "the same where nobody takes off"),
)
_FAILSAFES = (
    Parameter("COM_OF_LOSS_T", "s", 1.0, 0.1, 60.0, "offboard setpoints older than this are lost"),
    Parameter("FS_OFFBOARD_ACT", "", HOLD, 0, 4, f"when they are: {_ACTION}", True),
    Parameter("COM_DL_LOSS_T", "s", 10.0, 1.0, 300.0, "a ground station that is silent for so long is lost"),
    Parameter("NAV_DLL_ACT", "", RETURN, 0, 3, "when it is: 0 a warning, 1 hold, 2 return, 3 land", True),
    Parameter("BAT_LOW_THR", "", 0.15, 0.0, 0.5, "charge below which the battery is low, fraction"),
    Parameter("FS_BAT_LOW_ACT", "", NOTHING, 0, 4, f"when it is: {_ACTION}", True),
    Parameter("BAT_CRIT_THR", "", 0.07, 0.0, 0.5, "charge below which it is critical, and the motors are not armed"),
    Parameter("FS_BAT_CRIT_ACT", "", RETURN, 0, 4, f"when it is: {_ACTION}", True),
    Parameter("BAT_EMERGEN_THR", "", 0.05, 0.0, 0.5, "charge below which it is nearly empty"),
    Parameter("FS_BAT_EMER_ACT", "", LAND, 0, 4, f"when it is: {_ACTION}", True),
    Parameter("FS_MOTOR_ACT", "", LAND, 0, 4, f"when a motor gives less than it is asked for: {_ACTION}", True),
    Parameter("COM_POS_FS_DELAY", "s", 10.0, 0.1, 100.0, "without GPS or a sure position for so long it is lost"),
    Parameter("FS_ESTIMATE_ACT", "", DESCEND, 0, 4, f"when it is: {_ACTION}", True),
    Parameter(
        "EKF2_HGT_REF", "", GPS_HEIGHT, 0, 2, f"what the height comes from, from the start on: {_HEIGHTS}", True, True
    ),
    Parameter("SYS_FAILURE_EN", "", 0, 0, 1, "whether failures may be injected", True),
    Parameter("SYS_FAIL_BAT_LVL", "", 2, 1, 3, f"what a battery that is wrong reports: {_LEVELS}", True),
    Parameter("FS_FENCE_ACT", "", RETURN, 0, 4, f"outside of the fence: {_ACTION}", True),
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
_UNITS = {"altitude": "N/m", "pitch_outer": "rad/m", "roll_outer": "rad/m"}  # of P; the other loops': N/rad


def table(scene: "Scene") -> dict[str, Parameter]:
    """The parameters of a scene with an `[autopilot]`, by name; defaults are what the scene says.

    Raises:
        KeyedError: the scene sets a parameter that is not there, or to a value that it cannot have.
    """
    return dict(scene.once(_table))


def _table(scene: "Scene") -> dict[str, Parameter]:
    known = {p.name: p for p in (*of_gains(scene.section("gains")), *_FLIGHT, *_FAILSAFES)}
    for name, value in scene.lookup("autopilot.parameters").items():
        if name not in known:
            raise ConfigError.unknown(f"autopilot.parameters.{name}", "parameter", name, known)
        try:
            known[name].check(value)
        except ConfigError as error:
            raise error.under("autopilot.parameters") from None
        known[name] = known[name]._replace(default=float(value))
    return known


def changed(table: dict[str, Parameter], commands: Iterable[Any]) -> dict[str, float]:
    """The values after an operator's commands, as the autopilot has taken them."""
    values = {p.name: p.default for p in table.values()}
    for command in commands:
        known = table.get(command.text) if command.kind == "parameter" else None
        if known and command.values and known.allows(command.values[0]):
            values[known.name] = command.values[0]
    return values


def of_gains(gains: Any) -> list[Parameter]:
    """Those that are gains, with the numbers of a gain set as defaults."""
    limit = math.degrees(gains.tilt_limit)
    tilt = Parameter("MPC_TILTMAX_AIR", "deg", limit, min(limit, 5.0), 89.0, "maximum tilt about either axis")
    return [tilt, *(_gain(loop, k, getattr(gains, loop)[k]) for loop in _LOOPS for k in range(3))]


def _gain(loop: str, term: int, value: float) -> Parameter:
    reach = 5.0 * value or 100.0
    unit = _UNITS.get(loop, "N/rad") + ("", "/s", " s")[term]
    meaning = f"{_TERMS[term]} of the loop {loop}"
    return Parameter(f"{_LOOPS[loop]}_{_TERMS[term]}", unit, value, min(reach, 0.0), max(reach, 0.0), meaning)


def with_gains(gains: Any, values: dict[str, float]) -> Any:
    """The gain set with the gains among the parameters' `values`."""
    loops = {loop: tuple(values[f"{stem}_{term}"] for term in _TERMS) for loop, stem in _LOOPS.items()}
    tilt = values["MPC_TILTMAX_AIR"]
    unchanged = tilt == math.degrees(gains.tilt_limit)  # then to the bit
    return gains._replace(**loops, tilt_limit=gains.tilt_limit if unchanged else math.radians(tilt))
