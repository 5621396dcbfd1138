"""Requested bandwidths of `lapwing tune`."""

from typing import NamedTuple


class Bandwidths(NamedTuple):
    """Bandwidth of each loop [rad/s]: derivative gain times the plant's gain, approximately the crossover."""

    altitude: float = 13.0
    yaw: float = 17.4
    attitude: float = 26.0
    position: float = 4.9
