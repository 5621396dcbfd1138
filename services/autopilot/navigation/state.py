"""The state that the parts of the navigation share."""

from typing import NamedTuple

import numpy as np

from dynamics.lie.quaternion import NO_ROTATION
from dynamics.vector import ZERO
from services.autopilot.estimator.state import HISTORY, SIZE, WATCHED, Inertial, Memory, Nominal, State


class NavigationState(NamedTuple):
    """The filter, once it has begun."""

    begun: bool
    filter: State  # means nothing before


def blank() -> NavigationState:
    """Before the first reading."""
    n = WATCHED
    nominal = Nominal(NO_ROTATION, ZERO, ZERO, ZERO, ZERO, ZERO, ZERO, 0.0, 0.0, 0.0)
    inertial = Inertial(0, ZERO, ZERO, ZERO, ZERO, ZERO, False)
    memory = Memory(
        np.zeros((SIZE, SIZE)),
        np.zeros(SIZE),
        np.zeros(SIZE),
        np.zeros(SIZE),
        np.zeros((HISTORY, 8)),
        np.zeros(n, np.int64),
        np.zeros(n, np.int64),
        np.zeros(n, np.int64),
        np.zeros((n, 6)),
        np.zeros(n),
    )
    return NavigationState(False, State(nominal, inertial, memory))
