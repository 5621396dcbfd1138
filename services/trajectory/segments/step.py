"""A jump: the only segment that may break the continuity of a channel."""

from typing import Literal

from lapwing.services.trajectory.polynomial_piece import Piece
from lapwing.services.trajectory.segments.segment import Finite, Segment


class Step(Segment):
    """Jump to the value `to` at once; it takes no time."""

    kind: Literal["step"] = "step"
    to: Finite  # [u]

    def pieces(self, start: float) -> list[Piece]:
        """None: what follows starts at the new value."""
        return []

    def end(self, start: float) -> float:
        """`to`."""
        return self.to
