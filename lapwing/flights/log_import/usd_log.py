"""Columns of the Crazyflie's binary logs (micro SD deck), for the mappings of CSV files.

A file has a header (0xBC, version, event types with their variables) and records (event type, time, values),
little-endian. The time has 32 bits in milliseconds in version 1, and 64 bits in microseconds in version 2. Source: the
log format of the Crazyflie firmware's uSD deck driver.
"""

import struct
from pathlib import Path

import numpy as np

from lapwing.flights.log_import.log_conventions import parsing

MAGIC = 0xBC
CLOCKS = {1: ("<u4", 1e3), 2: ("<u8", 1.0)}  # type of the time, and microseconds in its unit, by version
TIME = "timestamp"  # [us]


def is_usd_log(path: Path) -> bool:
    """Return True if the file starts with the header of such a log."""
    with path.open("rb") as file:
        start = file.read(3)
    return len(start) == 3 and start[0] == MAGIC and struct.unpack_from("<H", start, 1)[0] in CLOCKS


def read_usd_log(path: Path) -> dict[str, np.ndarray]:
    """Return the columns of the event type with most records, and the column `timestamp` [us].

    Raises:
        ValueError: the file's header or all of its records are damaged.
    """
    with parsing(path, "log of the Crazyflie", "a file of its micro SD deck"):
        data = path.read_bytes()
        version, types = struct.unpack_from("<HH", data, 1)
        clock, unit = CLOCKS[version]
        events, at = {}, 5
        for _ in range(types):
            (event,) = struct.unpack_from("<H", data, at)
            _, at = _text(data, at + 2)
            (count,) = struct.unpack_from("<H", data, at)
            at += 2
            names, codes = [], ""
            for _ in range(count):
                text, at = _text(data, at)
                name, _, code = text.rpartition("(")
                names.append(name)
                codes += code.rstrip(")")
            events[event] = (names, np.dtype([("event", "<u2"), (TIME, clock), *_fields(names, codes)]))
    records: dict[int, list[int]] = {event: [] for event in events}
    while at + 2 <= len(data):
        (event,) = struct.unpack_from("<H", data, at)
        if event not in events or at + events[event][1].itemsize > len(data):
            break  # the checksum at the end, or a truncated record
        records[event].append(at)
        at += events[event][1].itemsize
    most = max(records, key=lambda event: len(records[event]), default=None)
    if most is None or not records[most]:
        raise ValueError(f"{path}: has no records; expected a file of the micro SD deck of a Crazyflie")
    dtype = events[most][1]
    width = dtype.itemsize
    rows = np.frombuffer(data, np.uint8)[np.array(records[most])[:, None] + np.arange(width)]
    table = np.ascontiguousarray(rows).view(dtype)[:, 0]
    return {name: table[name].astype(float) * (unit if name == TIME else 1.0) for name in (TIME, *events[most][0])}


def _text(data: bytes, at: int) -> tuple[str, int]:
    """Return the text up to the next zero byte, and the offset after it."""
    end = data.index(b"\0", at)
    return data[at:end].decode("ascii"), end + 1


def _fields(names: list[str], codes: str) -> list[tuple[str, str]]:
    kinds = {"B": "<u1", "b": "<i1", "H": "<u2", "h": "<i2", "I": "<u4", "i": "<i4", "f": "<f4", "Q": "<u8", "q": "<i8"}
    return [(name, kinds[code]) for name, code in zip(names, codes, strict=True)]
