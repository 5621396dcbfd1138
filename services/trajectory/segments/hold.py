"""Constant segment."""

from typing import Literal

from lapwing.services.trajectory.polynomial_piece import Piece
from lapwing.services.trajectory.segments.segment import Positive, Segment


class Hold(Segment):
    """Constant at the start value for `duration`."""

    kind: Literal["hold"] = "hold"
    duration: Positive  # [s] time that the segment takes

    def pieces(self, start: float) -> list[Piece]:
        """Return one constant piece."""
        return [Piece(self.duration, (start,))]
