"""Discontinuous step, the only segment that may break the continuity of a channel."""

from typing import Literal

from lapwing.services.trajectory.polynomial_piece import Piece
from lapwing.services.trajectory.segments.segment import Finite, Segment


class Step(Segment):
    """Instantaneous jump to the value `to`."""

    kind: Literal["step"] = "step"
    to: Finite  # [u] value at the end, in m or rad

    def pieces(self, start: float) -> list[Piece]:
        """Return no pieces; the next segment starts at the new value."""
        return []
