"""What `lapwing tune` is asked for."""

from typing import NamedTuple


class Bandwidths(NamedTuple):
    """What each loop is to reach: gain of its derivative term over the effect, nearly its crossover [rad/s]."""

    altitude: float = 13.0
    yaw: float = 17.4
    attitude: float = 26.0
    position: float = 4.9
