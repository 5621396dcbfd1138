from lapwing.services.trajectory.polynomial_piece import Piece
from lapwing.services.trajectory.segments import KINDS


def test_hold_is_constant():
    hold = KINDS["hold"](duration=2.0)
    assert hold.pieces(3.0) == [Piece(2.0, (3.0,))]
    assert hold.end(3.0) == 3.0
