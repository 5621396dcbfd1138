"""Reader of CSV files with the header `time,value`."""

import csv
import math
from pathlib import Path

from lapwing.cosim.scene import KeyOrigin, SceneError

HEADER = ["time", "value"]


def parse(text: str, path: Path) -> list[list[float]]:
    """Return the points [time [s], value] in the text of a file.

    Raises:
        SceneError: with the line of an invalid header or row, or of a time that does not ascend from 0.
    """
    rows = list(csv.reader(text.splitlines()))
    if not rows or [cell.strip() for cell in rows[0]] != HEADER:
        raise _error(path, 1, ",".join(rows[0]) if rows else "", "the header time,value")
    points: list[list[float]] = []
    for number, row in enumerate(rows[1:], start=2):
        try:
            time, value = (float(cell) for cell in row)
        except ValueError:
            raise _error(path, number, ",".join(row), "two numbers") from None
        if not (math.isfinite(time) and math.isfinite(value)):
            raise _error(path, number, ",".join(row), "finite numbers")
        if (points and time <= points[-1][0]) or (not points and time != 0.0):
            raise _error(path, number, str(time), "times that start at 0 and ascend")
        points.append([time, value])
    if len(points) < 2:
        raise _error(path, len(rows), str(len(points)), "at least two points")
    return points


def _error(path: Path, line: int, actual: str, expected: str) -> SceneError:
    return SceneError("", f"got {actual!r}", expected, KeyOrigin(path, line))
