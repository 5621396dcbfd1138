"""Linear interpolation of a table."""

import itertools
from typing import Annotated, Literal

from pydantic import Field, model_validator

from lapwing.dynamics.config_error import ConfigError
from lapwing.services.trajectory.polynomial_piece import Piece
from lapwing.services.trajectory.segments.segment import Finite, Segment

TOLERANCE = 1e-9  # [u] between a table's first value and the channel's value


class Table(Segment):
    """Points (time, value) with times ascending from 0; a scene may name a CSV file of them instead."""

    kind: Literal["table"] = "table"
    file: str = ""  # CSV file of the points
    points: Annotated[tuple[tuple[Finite, Finite], ...], Field(min_length=2)]  # [s], [u] time and value of each point

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
        """Return one linear piece between neighbouring points. Raise ConfigError if the table does not join."""
        if abs(self.points[0][1] - start) > TOLERANCE:
            message = f"the table starts at {self.points[0][1]}, but the channel is at {start}"
            raise ConfigError("points.0.1", f"{message}: put a ramp or a step before it")
        return [Piece(b[0] - a[0], (a[1], (b[1] - a[1]) / (b[0] - a[0]))) for a, b in itertools.pairwise(self.points)]

    def end(self, start: float) -> float:
        """Return the last value."""
        return self.points[-1][1]
