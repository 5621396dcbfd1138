"""Minimum-jerk quintic between two points of rest."""

from typing import Literal

from lapwing.services.trajectory.polynomial_piece import Piece
from lapwing.services.trajectory.segments.segment import Finite, Positive, Segment


class MinimumJerk(Segment):
    """10 s^3 - 15 s^4 + 6 s^5 to the value `to` over `duration`: continuous acceleration (theory, eq. (4.3))."""

    kind: Literal["minimum_jerk"] = "minimum_jerk"
    to: Finite  # [u] value at the end, in m or rad
    duration: Positive  # [s] time that the segment takes

    def pieces(self, start: float) -> list[Piece]:
        """Return one quintic piece."""
        change, T = self.to - start, self.duration
        cube, square = T * T * T, T * T
        jerk, snap, crackle = 10.0 * change / cube, -15.0 * change / (square * square), 6.0 * change / (cube * square)
        return [Piece(T, (start, 0.0, 0.0, jerk, snap, crackle))]
