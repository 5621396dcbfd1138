"""Stay at the value reached."""

from typing import Literal

from lapwing.services.trajectory.polynomial_piece import Piece
from lapwing.services.trajectory.segments.segment import Positive, Segment


class Hold(Segment):
    """Constant for `duration`."""

    kind: Literal["hold"] = "hold"
    duration: Positive  # [s]

    def pieces(self, start: float) -> list[Piece]:
        """One constant piece."""
        return [Piece(self.duration, (start,))]
