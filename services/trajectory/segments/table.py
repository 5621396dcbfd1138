"""Values from a CSV file, joined by straight lines."""

import csv
import itertools
import math
from pathlib import Path
from typing import Literal

from services.trajectory.piece import Piece
from services.trajectory.segments.segment import Segment

TOLERANCE = 1e-9  # [u] how far a table's first value may lie from where the channel is


class Table(Segment):
    """Points (time, value) of a CSV file with the header `time,value`; the first time is 0, times ascend."""

    kind: Literal["table"] = "table"
    file: str  # path, relative to the scene's folder

    def points(self, folder: Path) -> list[tuple[float, float]]:
        """The file's points (time [s], value [u]).

        Raises ValueError for a missing file, a wrong header, a cell that is no finite number, times that do not ascend.
        """
        path = folder / self.file
        try:
            with path.open(newline="", encoding="utf-8") as stream:
                rows = list(csv.reader(stream))
        except (OSError, UnicodeDecodeError) as error:
            raise ValueError(f"table {path}: cannot be read ({error})") from None
        if not rows or [cell.strip() for cell in rows[0]] != ["time", "value"]:
            raise ValueError(f"table {path}: the first line must be 'time,value'")
        points: list[tuple[float, float]] = []
        for number, row in enumerate(rows[1:], start=2):
            try:
                time, value = (float(cell) for cell in row)
            except ValueError:
                raise ValueError(
                    f"table {path}, line {number}: expected two numbers, found {','.join(row)!r}"
                ) from None
            if not (math.isfinite(time) and math.isfinite(value)):
                raise ValueError(f"table {path}, line {number}: expected finite numbers, found {','.join(row)!r}")
            if (points and time <= points[-1][0]) or (not points and time != 0.0):
                raise ValueError(f"table {path}, line {number}: times must start at 0 and ascend, found {time}")
            points.append((time, value))
        if len(points) < 2:
            raise ValueError(f"table {path}: needs at least two points")
        return points

    def pieces(self, start: float, folder: Path) -> list[Piece]:
        """One linear piece between neighbouring points; raises ValueError where the table does not join."""
        points = self.points(folder)
        if abs(points[0][1] - start) > TOLERANCE:
            raise ValueError(
                f"table {folder / self.file} starts at {points[0][1]}, but the channel is at {start}: "
                "put a ramp or a step before it"
            )
        return [Piece(b[0] - a[0], (a[1], (b[1] - a[1]) / (b[0] - a[0]))) for a, b in itertools.pairwise(points)]

    def end(self, start: float, folder: Path) -> float:
        """The last value."""
        return self.points(folder)[-1][1]
