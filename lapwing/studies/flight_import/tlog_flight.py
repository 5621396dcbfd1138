"""Recordings from MAVLink telemetry logs (.tlog) of ground stations, read by pymavlink.

Axes are NED and FRD. The time is that since boot, or the reception time of messages without it.
"""

from pathlib import Path
from typing import Any

import numpy as np

from lapwing.dynamics.constants import STANDARD_GRAVITY
from lapwing.dynamics.input_file import unreadable
from lapwing.studies.flight_import.channels import FLU, Channels, to_recording
from lapwing.studies.flight_import.dataflash_flight import motor_outputs, pulse_range
from lapwing.studies.flight_import.message_columns import Columns, MessageColumns
from lapwing.studies.flight_import.recording import Recording, Series, convert, session_notes
from lapwing.studies.rotation_arrays import from_euler, from_ned_frd, ned_to_enu

HIGHEST_SHARE = 2.0  # values of ACTUATOR_OUTPUT_STATUS above are pulses [us]
NO_AUTOPILOT = 8  # MAV_AUTOPILOT_INVALID
WRAP = 2**32  # [us] period of the time stamp of SERVO_OUTPUT_RAW
UNKNOWN_VOLTAGE = 65535  # SYS_STATUS.voltage_battery
FIX = 3  # GPS_RAW_INT.fix_type of a fix in three dimensions
DOWNWARD = 25  # MAV_SENSOR_ROTATION_PITCH_270
OTHER_VEHICLES = {  # MAV_TYPE
    1: "a fixed wing", 4: "a helicopter", 7: "an airship", 8: "a balloon", 9: "a rocket", 10: "a rover", 11: "a boat",
    12: "a submarine",
}  # fmt: skip
EPOCH = 1e15  # [us] above which a time stamp is Unix time
RATES, GYROSCOPE = ("rollspeed", "pitchspeed", "yawspeed"), ("xgyro", "ygyro", "zgyro")
ACCELEROMETER, MAGNETOMETER = ("xacc", "yacc", "zacc"), ("xmag", "ymag", "zmag")
PULSES = tuple(f"servo{n}_raw" for n in range(1, 17))
TIMES = ("_timestamp", "time_boot_ms", "time_usec")  # reception [s], and two of the message
USED = {  # fields of each message
    "ATTITUDE": ("roll", "pitch", "yaw", *RATES),
    "ATTITUDE_QUATERNION": ("q1", "q2", "q3", "q4", *RATES),
    "LOCAL_POSITION_NED": ("x", "y", "z", "vx", "vy", "vz"),
    "HIGHRES_IMU": (*GYROSCOPE, *ACCELEROMETER, *MAGNETOMETER, "abs_pressure"),
    "SCALED_IMU": ACCELEROMETER, "RAW_IMU": ACCELEROMETER,
    "SERVO_OUTPUT_RAW": PULSES, "ACTUATOR_OUTPUT_STATUS": ("active", "actuator"),
    "SYS_STATUS": ("voltage_battery", "current_battery"),
    "GPS_RAW_INT": ("lat", "lon", "alt"), "SCALED_PRESSURE": ("press_abs",), "DISTANCE_SENSOR": ("current_distance",),
}  # fmt: skip


def read_tlog_flight(path: Path) -> Recording:
    """Read the messages of the first autopilot in a telemetry log.

    Raises:
        ValueError: the file is not a telemetry log, or a required message is missing.
    """
    messages, boot, parameters, unknown, notes = _messages(path)
    channels = Channels(unknown=tuple(sorted(unknown)), notes=notes)

    def series(name: str, *fields: str, scale: float = 1.0) -> Series | None:
        if (table := messages.get(name)) is None:
            return None
        return Series.of(_time(name, table, boot), scale * table.stack(*fields))

    channels.attitude = convert(series("ATTITUDE_QUATERNION", "q1", "q2", "q3", "q4"), from_ned_frd)
    if channels.attitude is None:
        euler = series("ATTITUDE", "roll", "pitch", "yaw")
        channels.attitude = convert(euler, lambda v: from_ned_frd(from_euler(v)))
    channels.position = convert(series("LOCAL_POSITION_NED", "x", "y", "z"), ned_to_enu)
    channels.velocity = convert(series("LOCAL_POSITION_NED", "vx", "vy", "vz"), ned_to_enu)
    omega = series("HIGHRES_IMU", *GYROSCOPE) or series("ATTITUDE_QUATERNION", *RATES) or series("ATTITUDE", *RATES)
    channels.omega = convert(omega, lambda v: v * FLU)
    milli_g = 1e-3 * STANDARD_GRAVITY
    force = (
        series("HIGHRES_IMU", *ACCELEROMETER)
        or series("SCALED_IMU", *ACCELEROMETER, scale=milli_g)
        or series("RAW_IMU", *ACCELEROMETER, scale=milli_g)
    )
    channels.specific_force = convert(force, lambda v: v * FLU)
    battery = series("SYS_STATUS", "voltage_battery", "current_battery")
    channels.battery = convert(battery, _volts_and_amperes)
    channels.duty = _duty(messages, boot, parameters, channels)
    readings = {
        "imu": convert(series("HIGHRES_IMU", *GYROSCOPE, *ACCELEROMETER), lambda v: v * np.tile(FLU, 2)),
        "gps": convert(series("GPS_RAW_INT", "lat", "lon", "alt"), lambda v: v * [1e-7, 1e-7, 1e-3]),
        "baro": series("SCALED_PRESSURE", "press_abs", scale=100.0)
        or series("HIGHRES_IMU", "abs_pressure", scale=100.0),
        "mag": convert(series("HIGHRES_IMU", *MAGNETOMETER, scale=1e-4), lambda v: v * FLU),
        "rangefinder": series("DISTANCE_SENSOR", "current_distance", scale=1e-2),
    }
    channels.readings = {name: s for name, s in readings.items() if s is not None}
    messages.clear()  # the series are copies
    return to_recording(path, channels, "SERVO_OUTPUT_RAW, ACTUATOR_OUTPUT_STATUS", "HIGHRES_IMU, ATTITUDE")


def _volts_and_amperes(raw: np.ndarray) -> np.ndarray:
    """Convert voltage [mV] and current [cA], shape (n, 2); NaN for unknown values."""
    unknown = np.column_stack([raw[:, 0] == UNKNOWN_VOLTAGE, raw[:, 1] < 0.0])
    return np.where(unknown, np.nan, raw * [1e-3, 1e-2])


def _messages(path: Path) -> tuple[dict[str, Columns], float, dict[str, float], set[str], list[str]]:
    """Return messages of one autopilot by name, reception time of its boot [s], parameters, other names, and notes."""
    from pymavlink import mavutil

    fields = {name: (*TIMES, *others) for name, others in USED.items()}
    systems: dict[int, MessageColumns] = {}
    parameters: dict[str, float] = {}
    unknown: set[str] = set()
    system = None
    try:
        log = mavutil.mavlogfile(str(path))  # mavlink_connection would scan the file first, and fail on a damaged one
        while (message := log.recv_msg()) is not None:
            name, sender = message.get_type(), message.get_srcSystem()
            if name == "HEARTBEAT" and system is None and message.autopilot != NO_AUTOPILOT:
                system = sender
                if vehicle := OTHER_VEHICLES.get(message.type):
                    raise ValueError(f"{path}: is the log of {vehicle}; expected a multirotor's log")
            if name == "PARAM_VALUE" and message.get_srcComponent() == 1 and sender == system:
                parameters[str(message.param_id)] = float(message.param_value)
            if name == "BAD_DATA":
                continue
            if name not in USED:
                unknown.add(name)
            elif message.get_srcComponent() == 1 and _is_first_instance(name, message) and system in (None, sender):
                clock = getattr(message, "time_boot_ms", np.nan) * 1e-3
                systems.setdefault(sender, MessageColumns(fields)).add(message, clock)
    except OSError as error:
        raise unreadable(path, error, "a telemetry log (.tlog)") from None
    if system is None:
        system = next(iter(systems), None)
    messages = None if system is None else systems.get(system)
    if messages is None:
        raise ValueError(f"{path}: has no messages of an autopilot; expected a telemetry log (.tlog)")
    columns, sessions = messages.longest_session()
    boots = [table.get("_timestamp", np.nan) - 1e-3 * table.get("time_boot_ms", np.nan) for table in columns.values()]
    known = np.concatenate(boots)
    boot = float(np.nanmedian(known)) if np.isfinite(known).any() else 0.0
    return columns, boot, parameters, unknown, session_notes(sessions)


def _is_first_instance(name: str, message: Any) -> bool:
    """Return False for other sensors of the same kind, rangefinders that do not look down, and fixes that are none."""
    if name == "DISTANCE_SENSOR":
        return bool(message.orientation == DOWNWARD)
    if name == "GPS_RAW_INT":
        return bool(message.fix_type >= FIX)
    return all(getattr(message, field) == 0 for field in ("id", "port") if field in message.fieldnames)


def _time(name: str, table: Columns, boot: float) -> np.ndarray:
    """Return the times since boot [s] from the messages, or their reception times, shape (n,)."""
    if "time_boot_ms" in table:
        return table.get("time_boot_ms", np.nan) * 1e-3
    received = table.get("_timestamp", np.nan) - boot
    stamp = table.get("time_usec", 0.0)
    if name == "SERVO_OUTPUT_RAW":
        wraps = np.round((received * 1e6 - stamp) / WRAP)
        stamp = stamp + np.where((stamp > 0.0) & (received * 1e6 < EPOCH), WRAP * wraps, 0.0)
    return np.where((stamp > 0.0) & (stamp < EPOCH), stamp * 1e-6, received)


def _duty(messages: dict[str, Columns], boot: float, parameters: dict[str, float], channels: Channels) -> Series | None:
    """Return the shares of full throttle of the outputs that ArduPilot's parameters name, or of those that change."""
    name = "ACTUATOR_OUTPUT_STATUS" if "ACTUATOR_OUTPUT_STATUS" in messages else "SERVO_OUTPUT_RAW"
    if (table := messages.get(name)) is None:
        return None
    if name == "SERVO_OUTPUT_RAW":
        values = table.stack(*(pulse for pulse in PULSES if pulse in table))
    else:
        active = int(table.get("active", 0.0).max()).bit_length()
        values = table.stack("actuator")[:, :active]
    used = np.array(motor_outputs(parameters), int) - 1
    if not len(used) or used.max() >= values.shape[1]:
        used = np.flatnonzero(np.ptp(values, axis=0) > 0.0)
    if not len(used):
        return None
    channels.notes.append(f"motor commands from {name}, outputs {', '.join(str(k + 1) for k in used)}")
    if name == "SERVO_OUTPUT_RAW" or np.nanmax(values) > HIGHEST_SHARE:
        low, high = pulse_range(parameters)
        values = (values - low) / (high - low)
    return Series.of(_time(name, table, boot), values[:, used])
