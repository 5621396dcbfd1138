"""Linear segment."""

from typing import Literal

from pydantic import model_validator

from lapwing.services.trajectory.polynomial_piece import Piece
from lapwing.services.trajectory.segments.segment import Finite, Positive, Segment


class Ramp(Segment):
    """Constant rate to the value `to`, at `rate` or over `duration`."""

    kind: Literal["ramp"] = "ramp"
    to: Finite  # [u] value at the end, in m or rad
    rate: Positive | None = None  # [u/s] magnitude
    duration: Positive | None = None  # [s] time that the segment takes

    @model_validator(mode="after")
    def _one_of_two(self) -> "Ramp":
        if (self.rate is None) == (self.duration is None):
            raise ValueError("a ramp needs exactly one of rate and duration")
        return self

    def pieces(self, start: float) -> list[Piece]:
        """Return one linear piece, none if a ramp at a rate starts at `to`."""
        duration = self.duration or abs(self.to - start) / (self.rate or 1.0)
        return [Piece(duration, (start, (self.to - start) / duration))] if duration > 0.0 else []
