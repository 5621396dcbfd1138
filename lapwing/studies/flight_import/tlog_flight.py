"""Recordings from MAVLink telemetry logs (.tlog) of ground stations, read by pymavlink.

Axes are NED and FRD. The time is that since boot, or the reception time of messages without it.
"""

from collections import defaultdict
from pathlib import Path
from typing import Any

import numpy as np

from lapwing.studies.flight_import.channels import FLU, Channels, to_recording
from lapwing.studies.flight_import.recording import Recording, Series, convert
from lapwing.studies.flight_import.rotation_arrays import from_euler, from_ned_frd, ned_to_enu

PULSE_LOW, PULSE_SPAN = 1000.0, 1000.0  # [us]
STANDARD_GRAVITY = 9.80665
NO_AUTOPILOT = 8  # MAV_AUTOPILOT_INVALID
EPOCH = 1e15  # [us] above which a time stamp is Unix time
USED = {
    "ATTITUDE", "ATTITUDE_QUATERNION", "LOCAL_POSITION_NED", "HIGHRES_IMU", "SCALED_IMU", "SCALED_IMU2", "RAW_IMU",
    "SERVO_OUTPUT_RAW", "ACTUATOR_OUTPUT_STATUS", "SYS_STATUS", "GPS_RAW_INT", "SCALED_PRESSURE", "DISTANCE_SENSOR",
}  # fmt: skip


def read_tlog_flight(path: Path) -> Recording:
    """Read the messages of the first autopilot in a telemetry log.

    Raises:
        ValueError: the file is not a telemetry log, or a required message is missing.
    """
    messages, unknown = _messages(path)
    channels = Channels(unknown=tuple(sorted(unknown)))

    def series(name: str, *fields: str, scale: float = 1.0) -> Series | None:
        if (rows := messages.get(name)) is None:
            return None
        return Series.of([t for t, _ in rows], [[scale * getattr(m, f) for f in fields] for _, m in rows])

    channels.attitude = convert(series("ATTITUDE_QUATERNION", "q1", "q2", "q3", "q4"), from_ned_frd)
    if channels.attitude is None:
        euler = series("ATTITUDE", "roll", "pitch", "yaw")
        channels.attitude = convert(euler, lambda v: from_ned_frd(from_euler(v)))
    channels.position = convert(series("LOCAL_POSITION_NED", "x", "y", "z"), ned_to_enu)
    channels.velocity = convert(series("LOCAL_POSITION_NED", "vx", "vy", "vz"), ned_to_enu)
    rates = ("rollspeed", "pitchspeed", "yawspeed")
    omega = (
        series("HIGHRES_IMU", "xgyro", "ygyro", "zgyro")
        or series("ATTITUDE_QUATERNION", *rates)
        or series("ATTITUDE", *rates)
    )
    channels.omega = convert(omega, lambda v: v * FLU)
    milli_g = 1e-3 * STANDARD_GRAVITY
    force = series("HIGHRES_IMU", "xacc", "yacc", "zacc") or series("SCALED_IMU", "xacc", "yacc", "zacc", scale=milli_g)
    channels.specific_force = convert(
        force or series("RAW_IMU", "xacc", "yacc", "zacc", scale=milli_g), lambda v: v * FLU
    )
    battery = series("SYS_STATUS", "voltage_battery", "current_battery")
    channels.battery = convert(battery, lambda v: v * [1e-3, 1e-2])
    channels.duty = _duty(messages, channels)
    raw = ("xgyro", "ygyro", "zgyro", "xacc", "yacc", "zacc")
    readings = {
        "imu": convert(series("HIGHRES_IMU", *raw), lambda v: v * np.tile(FLU, 2)),
        "gps": convert(series("GPS_RAW_INT", "lat", "lon", "alt"), lambda v: v * [1e-7, 1e-7, 1e-3]),
        "baro": series("SCALED_PRESSURE", "press_abs", scale=100.0)
        or series("HIGHRES_IMU", "abs_pressure", scale=100.0),
        "mag": convert(series("HIGHRES_IMU", "xmag", "ymag", "zmag", scale=1e-4), lambda v: v * FLU),
        "rangefinder": series("DISTANCE_SENSOR", "current_distance", scale=1e-2),
    }
    channels.readings = {name: s for name, s in readings.items() if s is not None}
    return to_recording(path, channels, "SERVO_OUTPUT_RAW, ACTUATOR_OUTPUT_STATUS", "HIGHRES_IMU, ATTITUDE")


def _messages(path: Path) -> tuple[dict[str, list[tuple[float, Any]]], set[str]]:
    """Return (time [s] since boot, message) of one autopilot by name, and the names of all other messages."""
    from pymavlink import mavutil

    result: dict[str, list[tuple[float, Any]]] = defaultdict(list)
    unknown: set[str] = set()
    system = None
    try:
        log = mavutil.mavlogfile(str(path))  # mavlink_connection would scan the file first, and fail on a damaged one
        while (message := log.recv_msg()) is not None:
            name = message.get_type()
            if name == "HEARTBEAT" and system is None and message.autopilot != NO_AUTOPILOT:
                system = message.get_srcSystem()
            if name == "BAD_DATA":
                continue
            if name not in USED:
                unknown.add(name)
            elif message.get_srcComponent() == 1:
                result[name].append((message._timestamp, message))
    except OSError as error:
        raise ValueError(f"{path}: cannot be read: {(error.strerror or str(error)).lower()}") from None
    if not result:
        raise ValueError(f"{path}: has no messages of an autopilot; expected a telemetry log (.tlog)")
    if system is not None:
        result = {name: [r for r in rows if r[1].get_srcSystem() == system] for name, rows in result.items()}  # type: ignore[assignment]
    boot_times = [t - m.time_boot_ms * 1e-3 for rows in result.values() for t, m in rows if hasattr(m, "time_boot_ms")]
    boot = float(np.median(boot_times)) if boot_times else 0.0
    return {name: [(_time(t - boot, m), m) for t, m in rows] for name, rows in result.items() if rows}, unknown


def _time(received: float, message: Any) -> float:
    """Return the time since boot [s] from the message, or its reception time."""
    if hasattr(message, "time_boot_ms"):
        return float(message.time_boot_ms) * 1e-3
    stamp = getattr(message, "time_usec", 0)
    return float(stamp) * 1e-6 if 0 < stamp < EPOCH else received


def _duty(messages: dict[str, list[tuple[float, Any]]], channels: Channels) -> Series | None:
    """Return the fractions of full throttle of the outputs that change."""
    name = "ACTUATOR_OUTPUT_STATUS" if "ACTUATOR_OUTPUT_STATUS" in messages else "SERVO_OUTPUT_RAW"
    if name not in messages:
        return None
    rows = messages[name]
    if name == "SERVO_OUTPUT_RAW":
        values = np.array([[getattr(m, f"servo{n}_raw") for n in range(1, 9)] for _, m in rows], float)
        values = (values - PULSE_LOW) / PULSE_SPAN
    else:
        values = np.array([list(m.actuator)[: m.active.bit_length()] for _, m in rows], float)
    used = np.flatnonzero(np.ptp(values, axis=0) > 0.0)
    if not len(used):
        return None
    channels.notes.append(f"motor commands from {name}, outputs {', '.join(str(k + 1) for k in used)}")
    return Series.of([t for t, _ in rows], values[:, used])
