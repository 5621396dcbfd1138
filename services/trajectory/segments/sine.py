"""Sine about the start value."""

from typing import Literal

from lapwing.kernels import math
from lapwing.services.trajectory.polynomial_piece import Piece
from lapwing.services.trajectory.segments.segment import Finite, Positive, Segment


class Sine(Segment):
    """start + amplitude sin(2 pi frequency t) for `duration` (theory, eq. (4.4) with f_0 = f_1)."""

    kind: Literal["sine"] = "sine"
    amplitude: Finite  # [u] amplitude of the motion, in m or rad
    frequency: Positive  # [Hz] of the motion
    duration: Positive  # [s] time that the segment takes

    def pieces(self, start: float) -> list[Piece]:
        """Return one sinusoidal piece."""
        return [Piece(self.duration, (start,), self.amplitude, 2.0 * math.pi * self.frequency)]

    def end(self, start: float) -> float:
        """Return the value at the end of the sine."""
        cycles = self.frequency * self.duration
        # Whole cycles must end at the start value; 2 pi n is not representable and would leave a rounding error.
        return start + self.amplitude * math.sin(2.0 * math.pi * (cycles - round(cycles)))
