"""Recordings from ArduPilot's dataflash logs, binary (.bin) or text (.log), read by pymavlink.

ArduPilot's axes are NED and FRD. The log's parameters define the outputs of motors and their pulse ranges.
"""

import os
from collections import defaultdict
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np

from lapwing.studies.flight_import.channels import FLU, Channels, to_recording
from lapwing.studies.flight_import.recording import Recording, Series, convert
from lapwing.studies.flight_import.rotation_arrays import from_euler, from_ned_frd, ned_to_enu

FIRST_MOTOR, NINTH_MOTOR = 33, 82  # SERVOn_FUNCTION of motors 1 to 8, and 9 to 12
PULSE_LOW, PULSE_HIGH = 1000.0, 2000.0  # [us] default of the log's parameters
MILLIGAUSS = 1e-7  # [T]
INSTANCE = {
    "IMU": "I",
    "GPS": "I",
    "BARO": "I",
    "MAG": "I",
    "BAT": "Inst",
    "XKF1": "C",
    "NKF1": "C",
    "XKQ": "C",
    "NKQ": "C",
    "RFND": "Instance",
    "ARSP": "I",
}  # field of each message that numbers its source; fmt: skip
USED = (*INSTANCE, "ATT", "RCOU", "CURR", "EKF1")


def read_dataflash_flight(path: Path) -> Recording:
    """Read a dataflash log.

    Raises:
        ValueError: the file is not a dataflash log, or a required message is missing.
    """
    messages, parameters, unknown = _messages(path)
    channels = Channels(unknown=tuple(sorted(unknown)))

    def series(name: str, *fields: str) -> Series | None:
        rows = [m for m in messages.get(name, []) if all(f in m for f in fields)]
        return Series.of([m["TimeUS"] * 1e-6 for m in rows], [[m[f] for f in fields] for m in rows]) if rows else None

    def first(*choices: tuple[str, ...]) -> Series | None:
        return next((s for name, *fields in choices if (s := series(name, *fields)) is not None), None)

    quaternion = ("Q1", "Q2", "Q3", "Q4")
    channels.attitude = convert(first(("XKQ", *quaternion), ("NKQ", *quaternion)), from_ned_frd)
    if channels.attitude is None:
        euler = series("ATT", "Roll", "Pitch", "Yaw")
        channels.attitude = convert(euler, lambda v: from_ned_frd(from_euler(np.radians(v))))
    estimators = ("XKF1", "NKF1", "EKF1")
    channels.position = convert(first(*((name, "PN", "PE", "PD") for name in estimators)), ned_to_enu)
    channels.velocity = convert(first(*((name, "VN", "VE", "VD") for name in estimators)), ned_to_enu)
    channels.omega = convert(series("IMU", "GyrX", "GyrY", "GyrZ"), lambda v: v * FLU)
    channels.specific_force = convert(series("IMU", "AccX", "AccY", "AccZ"), lambda v: v * FLU)
    channels.battery = first(("BAT", "Volt", "Curr"), ("CURR", "Volt", "Curr"))
    channels.duty = _duty(messages, parameters, channels)
    raw = ("GyrX", "GyrY", "GyrZ", "AccX", "AccY", "AccZ")
    readings = {
        "imu": convert(series("IMU", *raw), lambda v: v * np.tile(FLU, 2)),
        "gps": series("GPS", "Lat", "Lng", "Alt"),
        "baro": series("BARO", "Press"),
        "mag": convert(series("MAG", "MagX", "MagY", "MagZ"), lambda v: v * FLU * MILLIGAUSS),
        "rangefinder": series("RFND", "Dist"),
        "airspeed": first(("ARSP", "DiffPress"), ("ARSP", "Press")),
    }
    channels.readings = {name: s for name, s in readings.items() if s is not None}
    return to_recording(path, channels, "RCOU", "IMU")


@contextmanager
def _silent() -> Iterator[None]:
    """Discard what pymavlink prints for each damaged byte; its indexer in C does not use `sys.stderr`."""
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


def _messages(path: Path) -> tuple[dict[str, list[dict[str, Any]]], dict[str, float], set[str]]:
    """Return the messages of the first instance by name, the parameters, and the names of all other messages."""
    from pymavlink.DFReader import DFReader_binary, DFReader_text

    result: dict[str, list[dict[str, Any]]] = defaultdict(list)
    parameters, unknown = {}, set()
    try:
        kind = DFReader_binary if path.suffix.lower() == ".bin" else DFReader_text
        with _silent(), _open_reader(kind, path) as reader:
            while (message := reader.recv_msg()) is not None:
                name, fields = message.get_type(), message.to_dict()
                if name == "PARM":
                    parameters[str(fields.get("Name"))] = float(fields.get("Value", 0.0))
                elif name in USED and "TimeUS" in fields:
                    if not fields.get(INSTANCE.get(name, ""), 0):
                        result[name].append(fields)
                else:
                    unknown.add(name)
    except OSError as error:
        raise ValueError(f"{path}: cannot be read: {(error.strerror or str(error)).lower()}") from None
    except Exception:  # pymavlink raises what its parser runs into
        raise ValueError(
            f"{path}: is not a readable dataflash log; expected a .bin or .log file of ArduPilot"
        ) from None
    if not result:
        raise ValueError(f"{path}: is not a readable dataflash log; expected a .bin or .log file of ArduPilot")
    return result, parameters, unknown - {"FMT", "FMTU", "UNIT", "MULT"}


def _duty(messages: dict[str, list[dict[str, Any]]], parameters: dict[str, float], channels: Channels) -> Series | None:
    rows = messages.get("RCOU")
    if not rows:
        return None
    outputs: dict[int, str] = {}
    for n in range(1, 33):
        function = int(parameters.get(f"SERVO{n}_FUNCTION", 0))
        if FIRST_MOTOR <= function < FIRST_MOTOR + 8:
            outputs[function - FIRST_MOTOR] = f"C{n}"
        elif NINTH_MOTOR <= function < NINTH_MOTOR + 4:
            outputs[8 + function - NINTH_MOTOR] = f"C{n}"
    used = [outputs[k] for k in sorted(outputs)] or [f"C{n}" for n in range(1, 5)]
    low = parameters.get("MOT_PWM_MIN", 0.0) or PULSE_LOW
    high = parameters.get("MOT_PWM_MAX", 0.0) or PULSE_HIGH
    values = np.array([[row.get(name, 0.0) for name in used] for row in rows], float)
    channels.notes.append(f"motor commands from RCOU {', '.join(used)}, pulses from {low:.0f} to {high:.0f} us")
    return Series.of([row["TimeUS"] * 1e-6 for row in rows], (values - low) / (high - low))
