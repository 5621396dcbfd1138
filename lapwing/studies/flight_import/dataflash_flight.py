"""Recordings from ArduPilot's dataflash logs, binary (.bin) or text (.log), read by pymavlink.

ArduPilot's axes are NED and FRD. The log's parameters define the outputs of motors and their pulse ranges. Of several
sensors of a kind, the first is used; of several cores of the EKF, the primary one at each time.
"""

import os
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np

from lapwing.dynamics.input_file import unreadable
from lapwing.studies.flight_import.channels import FLU, Channels, to_recording
from lapwing.studies.flight_import.message_columns import Columns, MessageColumns
from lapwing.studies.flight_import.recording import Recording, Series, convert, session_notes
from lapwing.studies.rotation_arrays import from_euler, from_ned_frd, ned_to_enu

FIRST_MOTOR, NINTH_MOTOR = 33, 82  # SERVOn_FUNCTION of motors 1 to 8, and 9 to 12
OUTPUTS = 32  # highest number of an output
PULSE_LOW, PULSE_HIGH = 1000.0, 2000.0  # [us] default of the log's parameters
MILLIGAUSS = 1e-7  # [T]
INSTANCES = ("I", "C", "Inst", "Instance")  # fields that number the source of a message
CORES = {"XKF1": "XKF4", "XKQ": "XKF4", "NKF1": "NKF4", "NKQ": "NKF4"}  # message that names the primary core
EKF2 = 2  # AHRS_EKF_TYPE
FIX = 3  # GPS.Status of a fix in three dimensions
QUATERNION, POSITION, VELOCITY = ("Q1", "Q2", "Q3", "Q4"), ("PN", "PE", "PD"), ("VN", "VE", "VD")
GYROSCOPE, ACCELEROMETER = ("GyrX", "GyrY", "GyrZ"), ("AccX", "AccY", "AccZ")
USED = {  # fields of each message
    **dict.fromkeys(("XKQ", "NKQ"), QUATERNION),
    **dict.fromkeys(("XKF1", "NKF1", "EKF1"), (*VELOCITY, *POSITION)),
    "ATT": ("Roll", "Pitch", "Yaw"),
    "IMU": (*GYROSCOPE, *ACCELEROMETER),
    "RCOU": tuple(f"C{n}" for n in range(1, OUTPUTS + 1)),
    **dict.fromkeys(("BAT", "CURR"), ("Volt", "Curr")),
    "GPS": ("Lat", "Lng", "Alt"),
    "BARO": ("Press",),
    "MAG": ("MagX", "MagY", "MagZ"),
    "RFND": ("Dist",),
    "ARSP": ("DiffPress", "Press"),
}


def read_dataflash_flight(path: Path) -> Recording:
    """Read a dataflash log.

    Raises:
        ValueError: the file is not a dataflash log, or a required message is missing.
    """
    messages, parameters, unknown, notes = _messages(path)
    channels = Channels(unknown=tuple(sorted(unknown)), notes=notes)

    def series(name: str, *fields: str) -> Series | None:
        table = messages.get(name)
        if table is None or not all(field in table for field in fields):
            return None
        return Series.of(table.get("TimeUS", np.nan) * 1e-6, table.stack(*fields))

    def first(*choices: tuple[str, ...]) -> Series | None:
        return next((s for name, *fields in choices if (s := series(name, *fields)) is not None), None)

    families = ("NK", "XK") if parameters.get("AHRS_EKF_TYPE") == EKF2 else ("XK", "NK")
    channels.attitude = convert(first(*((f"{family}Q", *QUATERNION) for family in families)), from_ned_frd)
    if channels.attitude is None:
        euler = series("ATT", "Roll", "Pitch", "Yaw")
        channels.attitude = convert(euler, lambda v: from_ned_frd(from_euler(np.radians(v))))
    estimators = (*(f"{family}F1" for family in families), "EKF1")
    channels.position = convert(first(*((name, *POSITION) for name in estimators)), ned_to_enu)
    channels.velocity = convert(first(*((name, *VELOCITY) for name in estimators)), ned_to_enu)
    channels.omega = convert(series("IMU", *GYROSCOPE), lambda v: v * FLU)
    channels.specific_force = convert(series("IMU", *ACCELEROMETER), lambda v: v * FLU)
    channels.battery = first(("BAT", "Volt", "Curr"), ("CURR", "Volt", "Curr"))
    channels.duty = _duty(path, messages, parameters, channels)
    readings = {
        "imu": convert(series("IMU", *GYROSCOPE, *ACCELEROMETER), lambda v: v * np.tile(FLU, 2)),
        "gps": series("GPS", "Lat", "Lng", "Alt"),
        "baro": series("BARO", "Press"),
        "mag": convert(series("MAG", "MagX", "MagY", "MagZ"), lambda v: v * FLU * MILLIGAUSS),
        "rangefinder": series("RFND", "Dist"),
        "airspeed": first(("ARSP", "DiffPress"), ("ARSP", "Press")),
    }
    channels.readings = {name: s for name, s in readings.items() if s is not None}
    messages.clear()  # the series are copies
    return to_recording(path, channels, "RCOU", "IMU")


@contextmanager
def _silent() -> Iterator[None]:
    """Discard the lines that pymavlink prints for each damaged byte; its indexer in C does not use `sys.stderr`."""
    kept = os.dup(2)
    try:
        with open(os.devnull, "wb") as null:
            os.dup2(null.fileno(), 2)
        with redirect_stdout(StringIO()), redirect_stderr(StringIO()):
            yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)


@contextmanager
def _open_reader(kind: type, path: Path) -> Iterator[Any]:
    """Yield a reader of pymavlink, and close its file, also if its constructor fails after opening it."""
    reader: Any = object.__new__(kind)
    try:
        reader.__init__(str(path))
        yield reader
    finally:
        for name in ("data_map", "filehandle"):
            if hasattr(reader, name):
                getattr(reader, name).close()


def _messages(path: Path) -> tuple[dict[str, Columns], dict[str, float], set[str], list[str]]:
    """Return messages of the used instances by name, parameters, names of all other messages, and notes."""
    from pymavlink.DFReader import DFReader_binary, DFReader_text

    messages = MessageColumns({name: ("TimeUS", *fields) for name, fields in USED.items()})
    primary: dict[str, int] = {}
    cores, parameters, unknown = set(), {}, set()
    damaged = f"{path}: is not a readable dataflash log; expected a .bin or .log file of ArduPilot"
    try:
        kind = DFReader_binary if path.suffix.lower() == ".bin" else DFReader_text
        with _silent(), _open_reader(kind, path) as reader:
            while (message := reader.recv_msg()) is not None:
                name = message.get_type()
                if name == "PARM":
                    parameters[str(getattr(message, "Name", None))] = float(getattr(message, "Value", 0.0))
                elif name in CORES.values():
                    primary[name] = max(int(getattr(message, "PI", 0)), 0)
                elif name in USED and hasattr(message, "TimeUS"):
                    core = primary.get(CORES.get(name, ""), 0)
                    instance = next((getattr(message, f) for f in INSTANCES if hasattr(message, f)), core)
                    if instance == core and (name != "GPS" or getattr(message, "Status", FIX) >= FIX):
                        messages.add(message, message.TimeUS * 1e-6)
                        cores.update([core] if name in CORES else [])
                else:
                    unknown.add(name)
    except OSError as error:
        raise unreadable(path, error, "a .bin or .log file of ArduPilot") from None
    except Exception:  # pymavlink raises exceptions of many types
        raise ValueError(damaged) from None
    if not len(messages):
        raise ValueError(damaged)
    columns, sessions = messages.longest_session()
    notes = [f"EKF core {', '.join(map(str, sorted(cores)))} was primary"] if cores - {0} else []
    return columns, parameters, unknown - {"FMT", "FMTU", "UNIT", "MULT"}, [*notes, *session_notes(sessions)]


def motor_outputs(parameters: dict[str, float]) -> list[int]:
    """Return the numbers of the outputs of motors 1, 2, ... from ArduPilot's parameters; empty if they have none."""
    outputs: dict[int, int] = {}
    for n in range(1, OUTPUTS + 1):
        function = int(parameters.get(f"SERVO{n}_FUNCTION", 0))
        if FIRST_MOTOR <= function < FIRST_MOTOR + 8:
            outputs[function - FIRST_MOTOR] = n
        elif NINTH_MOTOR <= function < NINTH_MOTOR + 4:
            outputs[8 + function - NINTH_MOTOR] = n
    return [outputs[k] for k in sorted(outputs)]


def pulse_range(parameters: dict[str, float]) -> tuple[float, float]:
    """Return the pulses [us] of motors at rest and at full throttle from ArduPilot's parameters."""
    return parameters.get("MOT_PWM_MIN", 0.0) or PULSE_LOW, parameters.get("MOT_PWM_MAX", 0.0) or PULSE_HIGH


def _duty(path: Path, messages: dict[str, Columns], parameters: dict[str, float], channels: Channels) -> Series | None:
    table = messages.get("RCOU")
    if table is None:
        return None
    outputs = motor_outputs(parameters)
    if not outputs and any(name.startswith("SERVO") and name.endswith("_FUNCTION") for name in parameters):
        raise ValueError(f"{path}: no output is a motor of a multirotor (SERVOn_FUNCTION); expected a multirotor's log")
    used = [f"C{n}" for n in outputs or range(1, 5)]
    if missing := [name for name in used if name not in table]:
        raise ValueError(f"{path}: no motor outputs {', '.join(missing)} in RCOU; use outputs that are logged")
    low, high = pulse_range(parameters)
    channels.notes.append(f"motor commands from RCOU {', '.join(used)}, pulses from {low:.0f} to {high:.0f} us")
    return Series.of(table.get("TimeUS", np.nan) * 1e-6, (table.stack(*used) - low) / (high - low))
