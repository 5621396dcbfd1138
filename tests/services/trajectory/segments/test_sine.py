import math

from lapwing.services.trajectory.polynomial_piece import Piece
from lapwing.services.trajectory.segments import KINDS

Sine = KINDS["sine"]


def test_sine_oscillates_about_its_start():
    assert Sine(amplitude=2.0, frequency=0.5, duration=4.0).pieces(1.0) == [Piece(4.0, (1.0,), 2.0, math.pi)]


def test_whole_sine_cycles_end_exactly_at_start():
    assert Sine(amplitude=2.0, frequency=0.5, duration=4.0).end(1.0) == 1.0
    assert Sine(amplitude=2.0, frequency=0.5, duration=4.5).end(1.0) == 1.0 + 2.0 * math.sin(math.pi / 4.0 * 2.0)
