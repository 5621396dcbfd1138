"""The estimate before there is one."""

from lapwing.dynamics.vector import Vec3
from lapwing.services.common.ports import StateEstimate

NOT_STARTED = 0xFF  # health before the estimator has begun

EXACT = StateEstimate()
"""An estimate at the origin, at rest, without error."""


def before(position_world: Vec3) -> StateEstimate:
    """The estimate before the filter has begun, of a vehicle that is put down at a place [m]."""
    return EXACT._replace(position_world=position_world, health=NOT_STARTED)
