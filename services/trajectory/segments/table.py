"""Values from a table, joined by straight lines."""

import itertools
from typing import Annotated, Literal

from pydantic import Field, model_validator

from lapwing.dynamics.config_error import ConfigError
from lapwing.services.trajectory.polynomial_piece import Piece
from lapwing.services.trajectory.segments.segment import Finite, Segment

TOLERANCE = 1e-9  # [u] how far a table's first value may lie from where the channel is


class Table(Segment):
    """Points (time, value); the first time is 0, times ascend. A scene may name a CSV file of them instead."""

    kind: Literal["table"] = "table"
    file: str = ""  # that the points were read from
    points: Annotated[tuple[tuple[Finite, Finite], ...], Field(min_length=2)]  # [s], [u]

    @model_validator(mode="after")
    def _ascending(self) -> "Table":
        times = [time for time, _ in self.points]
        if times[0] != 0.0:
            raise ConfigError("points.0.0", f"got {times[0]}", "times that start at 0")
        for number, (before, time) in enumerate(itertools.pairwise(times), start=1):
            if time <= before:
                raise ConfigError(f"points.{number}.0", f"got {time} after {before}", "times that ascend")
        return self

    def pieces(self, start: float) -> list[Piece]:
        """One linear piece between neighbouring points; raises KeyedError where the table does not join."""
        if abs(self.points[0][1] - start) > TOLERANCE:
            message = f"the table starts at {self.points[0][1]}, but the channel is at {start}"
            raise ConfigError("points.0.1", f"{message}: put a ramp or a step before it")
        return [Piece(b[0] - a[0], (a[1], (b[1] - a[1]) / (b[0] - a[0]))) for a, b in itertools.pairwise(self.points)]

    def end(self, start: float) -> float:
        """The last value."""
        return self.points[-1][1]
