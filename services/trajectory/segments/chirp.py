"""Linear chirp, for identifying a loop's response from a recorded flight."""

from typing import Literal

from lapwing.kernels import math
from lapwing.services.trajectory.polynomial_piece import Piece
from lapwing.services.trajectory.segments.segment import Finite, Positive, Segment


class Chirp(Segment):
    """start + amplitude sin(phase) with a linear frequency sweep (theory, eq. (4.4))."""

    kind: Literal["chirp"] = "chirp"
    amplitude: Finite  # [u] amplitude of the motion, in m or rad
    start_frequency: Positive  # [Hz] at the start
    end_frequency: Positive  # [Hz] at the end
    duration: Positive  # [s] time that the segment takes

    def pieces(self, start: float) -> list[Piece]:
        """Return one swept piece."""
        sweep = math.pi * (self.end_frequency - self.start_frequency) / self.duration
        return [Piece(self.duration, (start,), self.amplitude, 2.0 * math.pi * self.start_frequency, sweep)]

    def end(self, start: float) -> float:
        """Return the value at the end of the chirp."""
        cycles = 0.5 * (self.start_frequency + self.end_frequency) * self.duration
        return start + self.amplitude * math.sin(2.0 * math.pi * (cycles - round(cycles)))
