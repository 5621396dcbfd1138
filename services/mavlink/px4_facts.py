"""PX4 parameters that the autopilot lacks or names differently: facts of the vehicle, and translations.

Names and values are those of PX4's parameter reference. A PX4 parameter may correspond to several parameters of the
autopilot, its counterparts. Setting a PX4 parameter sets its counterparts.
"""

from collections.abc import Callable, Collection, Mapping, Sequence
from typing import NamedTuple

from lapwing.services.common.mavlink.dialect import mavlink
from lapwing.services.mavlink.vehicle_description import Battery, VehicleDescription

Values = Mapping[str, float]


class Fact(NamedTuple):
    """Parameter that is computed from the vehicle or from the autopilot's parameters."""

    name: str
    value: Callable[[Values], float]  # function of the autopilot's parameters
    integer: bool = True
    unit: str = ""
    # returns the autopilot's parameters for a value, or None for an unsupported value; None: read-only
    assign: Callable[[float], Values | None] | None = None
    at_reboot: bool = False  # a new value takes effect when the link restarts


def _translate_action(name: str, counterpart: str, actions: dict[int, int], default: int = 0) -> Fact:
    """Return a failsafe action of PX4; `actions`: action of the autopilot by action of PX4."""
    px4_actions = {own: px4 for px4, own in reversed(actions.items())}

    def assign(value: float) -> Values | None:
        return {counterpart: float(actions[int(value)])} if value in actions else None

    return Fact(name, lambda v: px4_actions.get(int(v.get(counterpart, NOTHING)), default), assign=assign)


def _constant(value: int) -> Callable[[Values], float]:
    return lambda _: float(value)


def _setting(name: str, default: int, allowed: Collection[int], at_reboot: bool = False) -> Fact:
    """Return a setting of the link, which has no counterpart in the autopilot."""
    return Fact(name, lambda _: float(default), assign=lambda x: {} if x in allowed else None, at_reboot=at_reboot)


SYSTEM_ID, COMPONENT_ID, TYPE = "MAV_SYS_ID", "MAV_COMP_ID", "MAV_TYPE"
PRESSURE_OFFSET = "SENS_DPRES_OFF"  # offset of the airspeed sensor, subtracted from its readings
_IDS = range(1, 251)  # PX4's bounds
_MULTIROTORS = (  # MAV_TYPE that PX4 accepts and flies as a multirotor
    mavlink.MAV_TYPE_QUADROTOR,
    mavlink.MAV_TYPE_HEXAROTOR,
    mavlink.MAV_TYPE_OCTOROTOR,
    mavlink.MAV_TYPE_TRICOPTER,
)
_TYPES = {  # MAV_TYPE by number of rotors
    3: mavlink.MAV_TYPE_TRICOPTER,
    4: mavlink.MAV_TYPE_QUADROTOR,
    6: mavlink.MAV_TYPE_HEXAROTOR,
    8: mavlink.MAV_TYPE_OCTOROTOR,
    10: mavlink.MAV_TYPE_DECAROTOR,
    12: mavlink.MAV_TYPE_DODECAROTOR,
}
SIM_IMU, SIM_MAG = 1310988, 197388  # device ids of simulated sensors: they need no calibration
GENERIC_FRAMES = {4: 4001, 6: 6001, 8: 8001}  # SYS_AUTOSTART of 4, 6 and 8 rotors in X
LOGGED_FROM_BOOT_TO_SHUTDOWN = 2  # SDLOG_MODE
INTERNAL_COMPASS, NO_COLLISION_PREVENTION = -1, -1  # CAL_MAG0_ROT, CP_DIST
NO_SWITCHES = ("MODE_SW", "FLTMODE", "RETURN_SW", "LOITER_SW", "OFFB_SW", "KILL_SW", "ARM_SW", "GEAR_SW", "TRANS_SW")
NO_THRESHOLDS = ("ARMSWITCH", "GEAR", "KILLSWITCH", "LOITER", "OFFB", "RETURN")
THRESHOLD = 0.75  # PX4's default
NOTHING, HOLD, RETURN, LAND, DESCEND, TERMINATE = range(6)  # failsafe actions of the autopilot
_WARN, _LAND, _RETURN_THEN_LAND = 0, 2, 3  # COM_LOW_BAT_ACT
# the autopilot's actions by PX4's
_GEOFENCE = {1: NOTHING, 0: NOTHING, 2: HOLD, 3: RETURN, 4: TERMINATE, 5: LAND}  # GF_ACTION
_MOTOR_LOSS = {0: NOTHING, 1: HOLD, 2: LAND, 3: RETURN, 4: TERMINATE}  # COM_ACT_FAIL_ACT
_DESCENT = {"GF_ACTION": 5, "COM_ACT_FAIL_ACT": 2}  # to show DESCEND as landing
_BATTERY = {  # COM_LOW_BAT_ACT: actions at the critical and at the emergency charge
    _WARN: (NOTHING, NOTHING),
    _LAND: (LAND, LAND),
    _RETURN_THEN_LAND: (RETURN, LAND),
}
_NO_SOURCE, _POWER_MODULE = -1, 0  # BAT1_SOURCE
MULTIROTOR = 0  # CA_AIRFRAME
SATELLITES = 16  # satellites of a fix, as in telemetry
FIRST_MOTOR = 101  # function of an output that drives motor 1


def vehicle_type(rotors: int) -> int:
    """Return the MAV_TYPE of a multirotor.

    Coaxial rotors count individually, as in PX4 and ArduPilot: MAV_TYPE_COAXIAL is a helicopter.
    """
    return _TYPES.get(rotors, mavlink.MAV_TYPE_GENERIC_MULTIROTOR)


def output_function(number: int | str) -> str:
    """Return the name of the parameter with the function of an output, counted from 1."""
    return f"PWM_MAIN_FUNC{number}"


def px4_facts(d: VehicleDescription) -> Sequence[Fact]:
    """Return the facts of a vehicle."""

    def is_fitted(sensor: str) -> int:
        return int(not d.sensors or sensor in d.sensors)  # without sensors the ground truth replaces all of them

    integers = {
        "SYS_AUTOSTART": GENERIC_FRAMES.get(len(d.rotors), GENERIC_FRAMES[4]),
        "SYS_HITL": 0,
        "SYS_HAS_NUM_ASPD": int("airspeed" in d.sensors),
        "CAL_GYRO0_ID": SIM_IMU * is_fitted("imu"),
        "CAL_ACC0_ID": SIM_IMU * is_fitted("imu"),
        "CAL_MAG0_ID": SIM_MAG * is_fitted("magnetometer"),
        "CAL_MAG1_ID": 0,
        "CAL_MAG2_ID": 0,
        **{f"CAL_MAG{k}_ROT": INTERNAL_COMPASS for k in range(3)},
        "SENS_BOARD_ROT": 0,
        "RC_CHAN_CNT": 0,
        "COM_OBS_AVOID": 0,
        "SDLOG_MODE": LOGGED_FROM_BOOT_TO_SHUTDOWN,
        **({} if d.gripper else {"PD_GRIPPER_EN": 0}),
        "CA_AIRFRAME": MULTIROTOR,
        "CA_ROTOR_COUNT": len(d.rotors),
        "BAT1_SOURCE": _POWER_MODULE if d.battery else _NO_SOURCE,
        "BAT1_N_CELLS": d.battery.cells if d.battery else 0,
    }
    integers |= {
        f"RC_MAP_{axis}": 0 for axis in ("ROLL", "PITCH", "YAW", "THROTTLE", "FLAPS", "AUX1", "AUX2", *NO_SWITCHES)
    }
    integers |= {f"COM_FLTMODE{slot}": -1 for slot in range(1, 7)}
    integers |= {output_function(k + 1): FIRST_MOTOR + k for k in range(len(d.rotors))}
    own_type = vehicle_type(len(d.rotors))
    return [
        _setting(SYSTEM_ID, d.system_id, _IDS, at_reboot=True),
        _setting(COMPONENT_ID, mavlink.MAV_COMP_ID_AUTOPILOT1, _IDS, at_reboot=True),
        _setting(TYPE, own_type, {own_type, *_MULTIROTORS}),
        *[Fact(name, _constant(value)) for name, value in integers.items()],
        *[Fact(f"SENS_BOARD_{axis}_OFF", lambda _: 0.0, False, "deg") for axis in "XYZ"],
        *(_battery(d.battery) if d.battery else ()),
        *[Fact(f"RC_{switch}_TH", lambda _: THRESHOLD, False) for switch in NO_THRESHOLDS],
        Fact("COM_LOW_BAT_ACT", _low_battery, assign=_assign_battery),
        _translate_action("GF_ACTION", "FS_FENCE_ACT", _GEOFENCE, _DESCENT["GF_ACTION"]),
        _translate_action("COM_ACT_FAIL_ACT", "FS_MOTOR_ACT", _MOTOR_LOSS, _DESCENT["COM_ACT_FAIL_ACT"]),
        # VTOL aircraft in forward flight only need an approach to their landing, as in PX4
        Fact("RTL_APPR_FORCE", lambda _: 0.0, assign=lambda x: {} if x in (0.0, 1.0) else None),
        Fact("CP_DIST", lambda _: NO_COLLISION_PREVENTION, False, "m"),
        Fact(PRESSURE_OFFSET, lambda _: 0.0, False, "Pa", assign=lambda x: {}),
    ]


def _battery(b: Battery) -> Sequence[Fact]:
    return [
        Fact("BAT1_V_CHARGED", lambda _: b.charged_voltage, False, "V"),
        Fact("BAT1_V_EMPTY", lambda _: b.empty_voltage, False, "V"),
        Fact("BAT1_CAPACITY", lambda _: b.capacity / 3.6, False, "mAh"),
        Fact("BAT1_V_LOAD_DROP", lambda _: 0.0, False, "V"),  # unused by PX4 if the resistance is set
        Fact("BAT1_R_INTERNAL", lambda _: b.resistance, False, "Ohm"),
    ]


def _assign_battery(value: float) -> Values | None:
    if value not in _BATTERY:
        return None
    critical, emergency = _BATTERY[int(value)]
    return {"FS_BAT_CRIT_ACT": critical, "FS_BAT_EMER_ACT": emergency}


def _low_battery(values: Values) -> float:
    """Return the PX4 action nearest to the autopilot's actions at critical and emergency charge."""
    critical = values.get("FS_BAT_CRIT_ACT", NOTHING)
    if critical in (LAND, DESCEND):
        return _LAND
    return _RETURN_THEN_LAND if critical == RETURN else _WARN
