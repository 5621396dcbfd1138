import math

import numpy as np
import pytest

from lapwing.services.trajectory.polynomial_piece import Channel, channel_at
from lapwing.services.trajectory.segments import KINDS


def test_chirp_frequency_sweeps_linearly():
    chirp = KINDS["chirp"](amplitude=0.5, start_frequency=0.2, end_frequency=3.0, duration=10.0)
    (piece,) = chirp.pieces(1.0)
    t = np.linspace(0.0, 10.0, 2001)
    phase = 2.0 * math.pi * np.cumsum(np.concatenate(([0.0], (0.2 + 0.28 * (t[1:] + t[:-1]) / 2.0) * np.diff(t))))
    channel = Channel(np.array([0.0]), np.array([piece.row()]))
    assert [channel_at(channel, x)[0] for x in t] == pytest.approx(1.0 + 0.5 * np.sin(phase), abs=1e-9)
    assert chirp.end(1.0) == pytest.approx(channel_at(channel, 10.0)[0], abs=1e-12)
