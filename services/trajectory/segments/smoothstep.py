"""Cubic between two points of rest."""

from typing import Literal

from lapwing.services.trajectory.polynomial_piece import Piece
from lapwing.services.trajectory.segments.segment import Finite, Positive, Segment


class Smoothstep(Segment):
    """3 s^2 - 2 s^3 to the value `to` over `duration`: continuous velocity (theory, eq. (4.2))."""

    kind: Literal["smoothstep"] = "smoothstep"
    to: Finite  # [u] value at the end, in m or rad
    duration: Positive  # [s] time that the segment takes

    def pieces(self, start: float) -> list[Piece]:
        """Return one cubic piece."""
        change, T = self.to - start, self.duration
        return [Piece(T, (start, 0.0, 3.0 * change / (T * T), -2.0 * change / (T * T * T)))]
