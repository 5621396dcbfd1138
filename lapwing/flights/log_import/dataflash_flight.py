"""Recordings from ArduPilot's dataflash logs, binary (.bin) or text (.log), read by pymavlink.

ArduPilot's axes are NED and FRD. The log's parameters define the outputs of motors and their pulse ranges. Of several
cores of the EKF, the primary one at each time is used.
"""

import os
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from dataclasses import replace
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np

from lapwing.flights.log_import.channels import Channels, to_recording
from lapwing.flights.log_import.log_conventions import FIX, direction, parsing, shares
from lapwing.flights.log_import.message_columns import Columns, MessageColumns
from lapwing.flights.log_import.recording import ELLIPSOID, SEA_LEVEL, Recording, Series, session_notes
from lapwing.flights.log_import.source_choice import Choices
from lapwing.services.ardupilot.servo_packet import pulse_range
from lapwing.services.common.ports import IMUS

FIRST_MOTOR, NINTH_MOTOR = 33, 82  # SERVOn_FUNCTION of motors 1 to 8, and 9 to 12
OUTPUTS = 32  # highest number of an output
MILLIGAUSS = 1e-7  # [T]
INSTANCES = ("I", "C", "Inst", "Instance")  # fields that number the source of a message
STATES = {"XKF1": "XKF4", "XKQ": "XKF4", "NKF1": "NKF4", "NKQ": "NKF4"}  # message with the state of each estimator
EKF2 = 2  # AHRS_EKF_TYPE
QUATERNION, POSITION, VELOCITY = ("Q1", "Q2", "Q3", "Q4"), ("PN", "PE", "PD"), ("VN", "VE", "VD")
GYROSCOPE, ACCELEROMETER = ("GyrX", "GyrY", "GyrZ"), ("AccX", "AccY", "AccZ")
HEALTH = {  # fields that are 0 for a sensor that fails
    "IMU": ("GH", "AH"), "BARO": ("Health", "H"), "MAG": ("Health",), "ARSP": ("H",),
}  # fmt: skip
SOLUTION = {  # bits of the estimator's solution that a quantity needs, one of each group
    "attitude": (1,), "velocity": (2, 4), "position": (8 | 16, 32 | 64),
}  # fmt: skip
GOOD_RANGE = 4  # RFND.Stat
ALTITUDE_RESET, YAW_RESET = 60, 62  # EV.Id
USED = {  # fields of each message
    **dict.fromkeys(("XKQ", "NKQ"), QUATERNION),
    **dict.fromkeys(("XKF1", "NKF1", "EKF1"), (*VELOCITY, *POSITION)),
    **dict.fromkeys(("XKF4", "NKF4"), ("PI", "OFN", "OFE", "SS")),
    "EV": ("Id",),
    "ATT": ("Roll", "Pitch", "Yaw"),
    "IMU": (*GYROSCOPE, *ACCELEROMETER, *HEALTH["IMU"]),
    "RCOU": tuple(f"C{n}" for n in range(1, OUTPUTS + 1)),
    **dict.fromkeys(("BAT", "CURR"), ("Volt", "Curr")),
    "GPS": ("Lat", "Lng", "Alt", "Status"),
    "GPA": ("Und",),
    "BARO": ("Press", *HEALTH["BARO"]),
    "MAG": ("MagX", "MagY", "MagZ", *HEALTH["MAG"]),
    "RFND": ("Dist", "Stat", "Orient", "Quality"),
    "ARSP": ("DiffPress", "Press", *HEALTH["ARSP"]),
}


def read_dataflash_flight(path: Path, choices: Choices = Choices()) -> Recording:  # noqa: B008
    """Read a dataflash log.

    Raises:
        ValueError: the file is not a dataflash log, or a required message is missing.
    """
    messages, parameters, unknown, notes = _messages(path)
    channels = Channels(unknown=tuple(sorted(unknown)), notes=notes, firmware="ardupilot")
    offer = channels.offer

    def every(name: str, *fields: str, scale: Any = 1.0, **labels: Any) -> list[Series]:
        return [
            Series.of(_time(table), scale * table.stack(*fields), _doubts(name, table), source=name, instance=number,
                      **labels)
            for number, table in _instances(messages.get(name))
            if all(field in table for field in fields)
        ]  # fmt: skip

    families = ("NK", "XK") if parameters.get("AHRS_EKF_TYPE") == EKF2 else ("XK", "NK")
    ned = {"frame": "NED", "datum": "EKF origin"}
    for family in families:
        offer("attitude", _estimates(messages, f"{family}Q", "attitude", QUATERNION, {"frame": "NED FRD"}, channels))
    offer("attitude", every("ATT", "Roll", "Pitch", "Yaw", scale=np.pi / 180.0, frame="NED FRD"))
    for name in (*(f"{family}F1" for family in families), "EKF1"):
        for quantity, fields in (("position", POSITION), ("velocity", VELOCITY)):
            offer(quantity, _estimates(messages, name, quantity, fields, ned, channels))
    offer("omega", every("IMU", *GYROSCOPE, frame="FRD"))
    offer("specific_force", every("IMU", *ACCELEROMETER, frame="FRD"))
    units = every("IMU", *GYROSCOPE, *ACCELEROMETER, frame="FRD")
    offer("imu", units)
    for name, unit in zip(IMUS[1:], units[1:], strict=False):
        offer(name, [replace(unit, instance=None)])
    offer("battery", (*every("BAT", "Volt", "Curr"), *every("CURR", "Volt", "Curr")))
    offer("duty", [_duty(path, messages, parameters, channels)])
    for fix in every("GPS", "Lat", "Lng", "Alt", datum=SEA_LEVEL):
        offer("gps", [_above_ellipsoid(fix, every("GPA", "Und"))])
    offer("baro", every("BARO", "Press"))
    offer("mag", every("MAG", "MagX", "MagY", "MagZ", scale=MILLIGAUSS, frame="FRD"))
    directions = {
        number: direction(table.get("Orient", 0.0)[0]) if "Orient" in table else ""
        for number, table in _instances(messages.get("RFND"))
    }
    offer("rangefinder", (replace(s, frame=directions[s.instance]) for s in every("RFND", "Dist")))
    offer("airspeed", (*every("ARSP", "DiffPress"), *every("ARSP", "Press")))
    messages.clear()  # the series are copies
    return to_recording(path, channels, "RCOU", "IMU", choices)


def _time(table: Columns) -> np.ndarray:
    return table.get("TimeUS", np.nan) * 1e-6


def _instances(table: Columns | None) -> list[tuple[int | None, Columns]]:
    """Return number and columns of each instance; the number is None if the messages have none."""
    if table is None:
        return []
    field = next((f for f in INSTANCES if f in table), None)
    if field is None:
        return [(None, table)]
    numbers = table.get(field, 0.0)
    return [(int(number), table.where(numbers == number)) for number in np.unique(numbers[np.isfinite(numbers)])]


def _doubts(name: str, table: Columns) -> list[tuple[str, np.ndarray]]:
    doubts = [(f"{field} 0", table.get(field, 1.0) == 0.0) for field in HEALTH.get(name, ()) if field in table]
    if name == "GPS":
        doubts.append(("no fix", table.get("Status", FIX) < FIX))
    if name == "RFND":
        doubts += [("status not good", table.get("Stat", GOOD_RANGE) != GOOD_RANGE)]
        doubts += [("quality 0", table.get("Quality", 100.0) == 0.0)]
    return doubts


def _above_ellipsoid(fix: Series, undulations: list[Series]) -> Series:
    """Return a fix with the height above the ellipsoid, if the log has the height of the ellipsoid above the geoid."""
    own = next((s for s in undulations if s.instance == fix.instance and len(s.time)), None)
    if own is None or not own.values.any():
        return fix
    height = fix.values[:, 2] - np.interp(fix.time, own.time, own.values[:, 0])
    return replace(fix, values=np.column_stack([fix.values[:, :2], height]), datum=ELLIPSOID)


def _estimates(
    messages: dict[str, Columns], name: str, quantity: str, fields: tuple[str, ...], labels: dict[str, str],
    channels: Channels,
) -> list[Series]:  # fmt: skip
    """Return the estimates of the primary core at each time, then those of each core.

    Where the primary core changes, or the estimator moves its position, height or yaw, is a reset.
    """
    table, state = messages.get(name), messages.get(STATES.get(name, ""))
    if table is None or not all(field in table for field in fields):
        return []
    cores = [(None, table)] if "C" not in table else [*_instances(table)]
    primary: list[tuple[int | None, Columns]] = []
    if "C" in table:
        core = _primary(_time(table), state)
        core = core if np.isin(core, [number or 0 for number, _ in cores]).any() else np.full(len(table), cores[0][0])
        used = table.where(table.get("C", 0.0) == core)
        numbers = np.unique(used.get("C", 0.0)).astype(int)
        note = f"EKF core {', '.join(map(str, numbers))} was primary"
        if set(numbers) - {0} and note not in channels.notes:
            channels.notes.append(note)
        primary = [(int(numbers[-1]), used)]
    result = []
    for number, own in (*primary, *(cores if len(cores) > 1 or not primary else ())):
        time, core = _time(own), own.get("C", 0.0)
        resets = [("EKF lane switch", np.diff(core, prepend=core[:1]) != 0.0)]
        doubts = []
        for each in np.unique(core):
            own_state = state.where(state.get("C", each) == each) if state is not None else None
            if own_state is None or not len(own_state):
                continue
            row = np.searchsorted(_time(own_state), time, side="right") - 1
            of_core = (core == each) & (row >= 0)
            if "SS" in own_state:
                solution = own_state.get("SS", 0.0)[np.maximum(row, 0)]
                doubts.append((f"{quantity} not valid", of_core & lacks(quantity, solution)))
            if quantity == "position" and "OFN" in own_state and "OFE" in own_state:
                offsets = own_state.stack("OFN", "OFE")
                moved = np.any(np.diff(offsets, axis=0, prepend=offsets[:1]) != 0.0, axis=1)
                for k in np.flatnonzero(moved):  # the estimate moved between two reports of its offset
                    span = (time > _time(own_state)[k - 1]) & (np.r_[0.0, time[:-1]] <= _time(own_state)[k])
                    resets.append(("EKF position reset", of_core & span))
        if (events := messages.get("EV")) is not None:
            for event, of in ((ALTITUDE_RESET, "position"), (YAW_RESET, "attitude")):
                for at in _time(events)[events.get("Id", 0.0) == event] if quantity == of else ():
                    first = np.searchsorted(time, at)
                    mask = np.zeros(len(time), bool)
                    mask[max(first - 1, 0) : first + 2] = True
                    resets.append(("EKF height reset" if of == "position" else "EKF yaw reset", mask))
        result.append(Series.of(time, own.stack(*fields), doubts, resets, source=name, instance=number, **labels))
    return result


def lacks(quantity: str, solution: np.ndarray) -> np.ndarray:
    """Return True where the flags of an estimator's solution do not include a quantity, shape (n,)."""
    return np.logical_or.reduce([solution.astype(int) & bits == 0 for bits in SOLUTION[quantity]])


def _primary(time: np.ndarray, state: Columns | None) -> np.ndarray:
    """Return the primary core at each time, 0 before it is known."""
    if state is None or not len(state):
        return np.zeros(len(time), int)
    row = np.searchsorted(_time(state), time, side="right") - 1
    named = np.maximum(state.get("PI", 0.0).astype(int), 0)
    return np.where(row >= 0, named[np.maximum(row, 0)], 0)


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
    """Return messages by name, parameters, names of all other messages, and notes."""
    from pymavlink.DFReader import DFReader_binary, DFReader_text

    messages = MessageColumns({name: ("TimeUS", *INSTANCES, *fields) for name, fields in USED.items()})
    parameters: dict[str, float] = {}
    unknown: set[str] = set()
    with parsing(path, "dataflash log", "a .bin or .log file of ArduPilot"):
        kind = DFReader_binary if path.suffix.lower() == ".bin" else DFReader_text
        with _silent(), _open_reader(kind, path) as reader:
            while (message := reader.recv_msg()) is not None:
                name = message.get_type()
                if name == "PARM":
                    parameters[str(getattr(message, "Name", None))] = float(getattr(message, "Value", 0.0))
                elif name in USED and hasattr(message, "TimeUS"):
                    messages.add(message, message.TimeUS * 1e-6)
                else:
                    unknown.add(name)
        if not len(messages):
            raise ValueError("no messages")
    columns, sessions = messages.longest_session()
    return columns, parameters, unknown - {"FMT", "FMTU", "UNIT", "MULT"}, session_notes(sessions)


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
    return Series.of(_time(table), shares(table.stack(*used), low, high), source="RCOU")
