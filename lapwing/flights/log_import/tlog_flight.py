"""Recordings from MAVLink telemetry logs (.tlog) of ground stations, read by pymavlink.

Axes are NED and FRD. The time is the vehicle's own: since boot, or Unix time that SYSTEM_TIME relates to it. A message
without a time is placed between its neighbours with one: the clock of the ground station may be set during the flight.
"""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from lapwing.dynamics.constants import STANDARD_GRAVITY
from lapwing.flights.log_import.channels import Channels, to_recording
from lapwing.flights.log_import.dataflash_flight import lacks, motor_outputs
from lapwing.flights.log_import.log_conventions import FIX, LogError, direction, out_of_range, parsing, shares
from lapwing.flights.log_import.message_columns import Columns, MessageColumns
from lapwing.flights.log_import.recording import ELLIPSOID, RESTART, SEA_LEVEL, Recording, Series, session_notes
from lapwing.flights.log_import.source_choice import Choices
from lapwing.services.ardupilot.servo_packet import pulse_range

HIGHEST_SHARE = 2.0  # values of ACTUATOR_OUTPUT_STATUS above are pulses [us]
NO_AUTOPILOT = 8  # MAV_AUTOPILOT_INVALID
WRAP = 2**32  # [us] period of the time stamp of SERVO_OUTPUT_RAW
UNKNOWN_VOLTAGE = 65535  # SYS_STATUS.voltage_battery
BAD_QUALITY = 1  # DISTANCE_SENSOR.signal_quality of an invalid distance
OTHER_VEHICLES = {  # MAV_TYPE
    1: "a fixed wing", 4: "a helicopter", 7: "an airship", 8: "a balloon", 9: "a rocket", 10: "a rover", 11: "a boat",
    12: "a submarine",
}  # fmt: skip
EPOCH = 1e15  # [us] above which a time stamp is Unix time
RATES, GYROSCOPE = ("rollspeed", "pitchspeed", "yawspeed"), ("xgyro", "ygyro", "zgyro")
ACCELEROMETER, MAGNETOMETER = ("xacc", "yacc", "zacc"), ("xmag", "ymag", "zmag")
PULSES = tuple(f"servo{n}_raw" for n in range(1, 17))
TIMES = ("_timestamp", "time_boot_ms", "time_usec")  # reception [s], and two of the message
INSTANCES = {  # field that numbers the source of a message
    **dict.fromkeys(("HIGHRES_IMU", "RAW_IMU", "DISTANCE_SENSOR"), "id"), "SERVO_OUTPUT_RAW": "port",
}  # fmt: skip
STEADY = ("HIGHRES_IMU", "RAW_IMU")  # messages whose time_usec is that of sending
FIXES = ("GPS_RAW_INT", "GPS2_RAW")
STATES = ("ESTIMATOR_STATUS", "EKF_STATUS_REPORT")  # messages with flags of the estimator's solution
USED = {  # fields of each message
    "ATTITUDE": ("roll", "pitch", "yaw", *RATES),
    "ATTITUDE_QUATERNION": ("q1", "q2", "q3", "q4", *RATES),
    "LOCAL_POSITION_NED": ("x", "y", "z", "vx", "vy", "vz"),
    "HIGHRES_IMU": (*GYROSCOPE, *ACCELEROMETER, *MAGNETOMETER, "abs_pressure"),
    "SCALED_IMU": ACCELEROMETER, "RAW_IMU": ACCELEROMETER,
    "SERVO_OUTPUT_RAW": PULSES, "ACTUATOR_OUTPUT_STATUS": ("active", "actuator"),
    "SYS_STATUS": ("voltage_battery", "current_battery"),
    **dict.fromkeys(FIXES, ("lat", "lon", "alt", "alt_ellipsoid", "fix_type")), "SCALED_PRESSURE": ("press_abs",),
    "DISTANCE_SENSOR": ("current_distance", "min_distance", "max_distance", "orientation", "signal_quality"),
    "SYSTEM_TIME": ("time_unix_usec",), "ODOMETRY": ("reset_counter",), **dict.fromkeys(STATES, ("flags",)),
}  # fmt: skip


def read_tlog_flight(path: Path, choices: Choices = Choices()) -> Recording:  # noqa: B008
    """Read the messages of the first autopilot in a telemetry log.

    Raises:
        ValueError: the file is not a telemetry log, or a required message is missing.
    """
    messages, clock, parameters, unknown, notes = _messages(path)
    channels = Channels(unknown=tuple(sorted(unknown)), notes=notes)
    offer = channels.offer

    def every(name: str, *fields: str, scale: Any = 1.0, quantity: str = "", **labels: Any) -> list[Series]:
        result = []
        for number, table in _instances(name, messages):
            if not all(field in table for field in fields):
                continue
            time = clock.of(name, table)
            doubts, resets = _flags(name, table), []
            if quantity:
                doubts += [
                    (f"{quantity} not valid", lacks(quantity, flags))
                    for state in STATES
                    if (flags := _held(time, messages.get(state), clock, state, "flags")) is not None
                ]
                moved = _held(time, messages.get("ODOMETRY"), clock, "ODOMETRY", "reset_counter")
                resets = [("reset", np.diff(moved, prepend=moved[:1]) != 0.0)] if moved is not None else []
            values = scale * table.stack(*fields)
            result.append(Series.of(time, values, doubts, resets, source=name, instance=number, **labels))
        return result

    for name, fields in (("ATTITUDE_QUATERNION", ("q1", "q2", "q3", "q4")), ("ATTITUDE", ("roll", "pitch", "yaw"))):
        offer("attitude", every(name, *fields, quantity="attitude", frame="NED FRD"))
    for quantity, fields in (("position", ("x", "y", "z")), ("velocity", ("vx", "vy", "vz"))):
        offer(quantity, every("LOCAL_POSITION_NED", *fields, quantity=quantity, frame="NED", datum="local origin"))
    for name, fields in (("HIGHRES_IMU", GYROSCOPE), ("ATTITUDE_QUATERNION", RATES), ("ATTITUDE", RATES)):
        offer("omega", every(name, *fields, frame="FRD"))
    milli_g = 1e-3 * STANDARD_GRAVITY
    for name, unit in (("HIGHRES_IMU", 1.0), ("SCALED_IMU", milli_g), ("RAW_IMU", milli_g)):
        offer("specific_force", every(name, *ACCELEROMETER, scale=unit, frame="FRD"))
    battery = every("SYS_STATUS", "voltage_battery", "current_battery")
    offer("battery", (replace(s, values=_volts_and_amperes(s.values)) for s in battery))
    offer("duty", _duty(messages, clock, parameters, channels))
    offer("imu", every("HIGHRES_IMU", *GYROSCOPE, *ACCELEROMETER, frame="FRD"))
    for name in FIXES:
        for field, datum in (("alt_ellipsoid", ELLIPSOID), ("alt", SEA_LEVEL)):
            fixes = every(name, "lat", "lon", field, scale=np.array([1e-7, 1e-7, 1e-3]), datum=datum)
            offer("gps", (s for s in fixes if s.values[:, 2].any()))  # 0: not filled by the sender
    offer("baro", every("SCALED_PRESSURE", "press_abs", scale=100.0))
    offer("baro", every("HIGHRES_IMU", "abs_pressure", scale=100.0))
    offer("mag", every("HIGHRES_IMU", *MAGNETOMETER, scale=1e-4, frame="FRD"))
    for sensor in every("DISTANCE_SENSOR", "orientation", "current_distance", scale=np.array([1.0, 1e-2])):
        for number in np.unique(sensor.values[:, 0]):
            looking = sensor.values[:, 0] == number
            doubts = {cause: mask[looking] for cause, mask in sensor.doubts.items()}
            offer("rangefinder", [replace(
                sensor.select(looking), values=sensor.values[looking, 1:], doubts=doubts,
                frame=direction(number),
            )])  # fmt: skip
    messages.clear()  # the series are copies
    return to_recording(path, channels, "SERVO_OUTPUT_RAW, ACTUATOR_OUTPUT_STATUS", "HIGHRES_IMU, ATTITUDE", choices)


def _instances(name: str, messages: Mapping[str, Columns]) -> list[tuple[int | None, Columns]]:
    """Return number and columns of each instance; the number is None for a single one with the number 0."""
    if (table := messages.get(name)) is None:
        return []
    field = INSTANCES.get(name, "")
    numbers = np.unique(table.get(field, 0.0))
    if len(numbers) == 1 and numbers[0] == 0.0:
        return [(None, table)]
    return [(int(number), table.where(table.get(field, 0.0) == number)) for number in numbers]


def _flags(name: str, table: Columns) -> list[tuple[str, np.ndarray]]:
    """Return the doubts that the fields of a message express."""
    if name in FIXES:
        return [("no fix", table.get("fix_type", FIX) < FIX)]
    if name == "DISTANCE_SENSOR":
        limits = out_of_range(*(table.get(f"{f}_distance", 0.0) for f in ("current", "min", "max")))
        return [("invalid quality", table.get("signal_quality", 0.0) == BAD_QUALITY), limits]
    return []


def _held(time: np.ndarray, table: Columns | None, clock: "_Clock", name: str, field: str) -> np.ndarray | None:
    """Return the latest value of a field of another message at each time, its first one before; None without any."""
    if table is None or field not in table:
        return None
    own = Series.of(clock.of(name, table), table.get(field, 0.0))
    return own.values[np.maximum(np.searchsorted(own.time, time, side="right") - 1, 0), 0]


def _volts_and_amperes(raw: np.ndarray) -> np.ndarray:
    """Convert voltage [mV] and current [cA], shape (n, 2); NaN for unknown values."""
    unknown = np.column_stack([raw[:, 0] == UNKNOWN_VOLTAGE, raw[:, 1] < 0.0])
    return np.where(unknown, np.nan, raw * [1e-3, 1e-2])


def _messages(path: Path) -> tuple[dict[str, Columns], "_Clock", dict[str, float], set[str], list[str]]:
    """Return messages of one autopilot by name, its clock, parameters, other names, and notes."""
    from pymavlink import mavutil

    fields = {name: (*TIMES, *filter(None, [INSTANCES.get(name)]), *others) for name, others in USED.items()}
    systems: dict[int, MessageColumns] = {}
    parameters: dict[str, float] = {}
    unknown: set[str] = set()
    system = None
    with parsing(path, "telemetry log", "a telemetry log (.tlog)"):
        log = mavutil.mavlogfile(str(path))  # mavlink_connection would scan the file first, and fail on a damaged one
        while (message := log.recv_msg()) is not None:
            name, sender = message.get_type(), message.get_srcSystem()
            if name == "HEARTBEAT" and system is None and message.autopilot != NO_AUTOPILOT:
                system = sender
                if vehicle := OTHER_VEHICLES.get(message.type):
                    raise LogError(f"is the log of {vehicle}; expected a multirotor's log")
            if name == "PARAM_VALUE" and message.get_srcComponent() == 1 and sender == system:
                parameters[str(message.param_id)] = float(message.param_value)
            if name == "BAD_DATA":
                continue
            if name not in USED:
                unknown.add(name)
            elif message.get_srcComponent() == 1 and system in (None, sender):
                systems.setdefault(sender, MessageColumns(fields)).add(message, _own_time(name, message))
    if system is None:
        system = next(iter(systems), None)
    messages = None if system is None else systems.get(system)
    if messages is None:
        raise ValueError(f"{path}: has no messages of an autopilot; expected a telemetry log (.tlog)")
    columns, sessions = messages.longest_session()
    clock = _Clock(messages.clock, columns)
    return columns, clock, parameters, unknown, [*session_notes(sessions), *clock.notes]


def _own_time(name: str, message: Any) -> float:
    """Return the time since boot at which a message was sent [s], NaN if it does not say."""
    if (boot := getattr(message, "time_boot_ms", 0)) > 0:
        return float(boot) * 1e-3
    stamp = getattr(message, "time_usec", 0) if name in STEADY else 0
    return stamp * 1e-6 if 0 < stamp < EPOCH else np.nan


class _Clock:
    """Clock of the vehicle.

    Attributes:
        notes: remark on a clock of the ground station that was set during the flight.
    """

    def __init__(self, clock: np.ndarray, messages: Mapping[str, Columns]):
        """Take the times of all messages of the log by the vehicle's clock [s], and the messages of the session."""
        numbers = np.concatenate([table.numbers for table in messages.values()])
        received = np.concatenate([table.get("_timestamp", np.nan) for table in messages.values()])
        order = np.argsort(numbers)
        steps = np.diff(received[order], prepend=received[order[:1]])
        self._all, self._steady = numbers[order], np.cumsum(np.where(steps < 0.0, 0.0, steps))
        known = np.isfinite(clock[numbers[order]])
        self._numbers, self._received = numbers[order][known], received[order][known]
        self._clock = np.maximum.accumulate(clock[self._numbers]) if known.any() else np.empty(0)
        offset = self._received - self._clock
        jumps = np.abs(np.diff(offset)) > RESTART
        self.notes = []
        if jumps.any():
            self.notes.append(f"the ground station's clock was set {int(jumps.sum())} times: the vehicle's is used")
        self._unix = np.nan
        if (system := messages.get("SYSTEM_TIME")) is not None:
            unix, boot = system.get("time_unix_usec", 0.0), system.get("time_boot_ms", np.nan)
            if (unix > EPOCH).any():
                self._unix = float(np.median((1e-6 * unix - 1e-3 * boot)[unix > EPOCH]))

    def of(self, name: str, table: Columns) -> np.ndarray:
        """Return the times since boot of messages [s], shape (n,)."""
        placed = self._placed(table)
        if "time_boot_ms" in table:
            boot = table.get("time_boot_ms", np.nan) * 1e-3
            return np.where(boot > 0.0, boot, placed)  # 0: the sender has no clock
        stamp = table.get("time_usec", 0.0)
        if name == "SERVO_OUTPUT_RAW" and len(self._clock):
            wraps = np.round((placed * 1e6 - stamp) / WRAP)
            stamp = stamp + np.where(stamp > 0.0, WRAP * wraps, 0.0)
        unix = stamp * 1e-6 - self._unix if np.isfinite(self._unix) else placed
        return np.where(stamp > EPOCH, unix, np.where(stamp > 0.0, stamp * 1e-6, placed))

    def _placed(self, table: Columns) -> np.ndarray:
        """Return the times between those of the neighbours with a time, or of reception if no message has one."""
        received = table.get("_timestamp", np.nan)
        if not len(self._clock):
            return self._steady[np.searchsorted(self._all, table.numbers)]
        after = np.searchsorted(self._numbers, table.numbers)
        before = np.maximum(after - 1, 0)
        last = len(self._clock) - 1
        time = self._clock[before] + (received - self._received[before])
        low = np.where(after > 0, self._clock[before], -np.inf)
        high = np.where(after <= last, self._clock[np.minimum(after, last)], np.inf)
        return np.clip(time, low, high)


def _duty(
    messages: dict[str, Columns], clock: _Clock, parameters: dict[str, float], channels: Channels
) -> list[Series]:
    """Return the shares of full throttle of the outputs that ArduPilot's parameters name, or of those that change."""
    name = "ACTUATOR_OUTPUT_STATUS" if "ACTUATOR_OUTPUT_STATUS" in messages else "SERVO_OUTPUT_RAW"
    result: list[Series] = []
    for number, table in _instances(name, messages):
        if name == "SERVO_OUTPUT_RAW":
            values = table.stack(*(pulse for pulse in PULSES if pulse in table))
        else:
            active = int(table.get("active", 0.0).max()).bit_length()
            values = table.stack("actuator")[:, :active]
        used = np.array(motor_outputs(parameters), int) - 1
        if not len(used) or used.max() >= values.shape[1]:
            used = np.flatnonzero(np.ptp(values, axis=0) > 0.0)
        if not len(used):
            continue
        if not result:
            channels.notes.append(f"motor commands from {name}, outputs {', '.join(str(k + 1) for k in used)}")
        if name == "SERVO_OUTPUT_RAW" or np.nanmax(values) > HIGHEST_SHARE:
            low, high = pulse_range(parameters)
            values = shares(values, low, high)
        result.append(Series.of(clock.of(name, table), values[:, used], source=name, instance=number))
    return result
