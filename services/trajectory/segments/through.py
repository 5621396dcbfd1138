"""Quintic between two points that are passed at given rates."""

from typing import Literal

from lapwing.services.trajectory.polynomial_piece import Piece
from lapwing.services.trajectory.segments.segment import Finite, Positive, Segment


class Through(Segment):
    """Quintic to the value `to` over `duration`, with given rates and no acceleration at both ends."""

    kind: Literal["through"] = "through"
    to: Finite  # [u] value at the end, in m or rad
    duration: Positive  # [s] time that the segment takes
    start_rate: Finite = 0.0  # [u/s] at the start, that of the end of the segment before
    end_rate: Finite = 0.0  # [u/s] at the end

    def pieces(self, start: float) -> list[Piece]:
        """Return one quintic piece."""
        T, change, first, last = self.duration, self.to - start, self.start_rate, self.end_rate
        cube = T * T * T
        jerk = (10.0 * change - (6.0 * first + 4.0 * last) * T) / cube
        snap = ((8.0 * first + 7.0 * last) * T - 15.0 * change) / (cube * T)
        crackle = (6.0 * change - 3.0 * (first + last) * T) / (cube * T * T)
        return [Piece(T, (start, first, 0.0, jerk, snap, crackle))]
