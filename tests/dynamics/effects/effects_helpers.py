"""Helpers shared by the tests of effects."""

import numpy as np

from lapwing.dynamics.effects._types import Factors, Loads

NO_FACTORS = Factors((1.0,) * 4, (1.0,) * 4)
NO_LOADS = Loads((0.0,) * 4, (0.0,) * 4)


def rotation_of(s):
    return np.array(s.R_world_body).reshape(3, 3)
