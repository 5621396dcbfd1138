"""State that the estimator blocks share."""

from typing import NamedTuple

from lapwing.dynamics.lie.quaternion import NO_ROTATION
from lapwing.dynamics.vector import ZERO
from lapwing.services.autopilot.estimator.filter_state import Inertial, Nominal, State, new_memory


class NavigationState(NamedTuple):
    """State of the filter, and whether it has started."""

    started: bool
    filter: State  # undefined before the start


def blank() -> NavigationState:
    """Return the state before the first reading."""
    nominal = Nominal(NO_ROTATION, ZERO, ZERO, ZERO, ZERO, ZERO, ZERO, 0.0, 0.0, 0.0)
    inertial = Inertial(0, ZERO, ZERO, ZERO, ZERO, ZERO, False, 0)
    return NavigationState(False, State(nominal, inertial, new_memory()))
