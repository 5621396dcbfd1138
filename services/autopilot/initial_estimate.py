"""Estimates before the filter has started."""

from lapwing.dynamics.vector import Vec3
from lapwing.services.common.ports import StateEstimate

NOT_STARTED = 0xFF  # health before the filter has started

EXACT = StateEstimate()
"""Estimate at the origin, at rest, without error."""


def estimate_before_start(position_world: Vec3) -> StateEstimate:
    """Return the estimate before the filter has started, at the start position [m]."""
    return EXACT._replace(position_world=position_world, health=NOT_STARTED)
