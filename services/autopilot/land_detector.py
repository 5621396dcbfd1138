"""Land detector: take-off, landing and motor cut-off (theory, section 4.5)."""

from typing import NamedTuple

from lapwing.kernels import always_inline
from lapwing.services.common.ports import Setpoint, StateEstimate

ON_GROUND, FLYING, LANDED = 0, 1, 2  # motors off before the first take-off, flying, off after a landing
# [m] over the resting height: below it, on the way to the ground, the motors stop; paper, section 6.1
CUT_HEIGHT = 0.05
LANDED_TIME = 2.0  # [s] at rest with a setpoint on the ground, after which the motors stop at any estimated height
LANDED_HEIGHT_ERROR = 0.5  # [m] maximum error of the estimated height for that
LANDED_SPEED = 0.1  # [m/s] maximum estimated vertical speed at rest


class LandedState(NamedTuple):
    """State of the land detector."""

    name: int  # ON_GROUND, FLYING or LANDED
    waiting: float  # [s] at rest with a setpoint on the ground


INITIAL_LANDED_STATE = LandedState(ON_GROUND, 0.0)


@always_inline
def update_landed_state(
    landed: LandedState, resting_height: float, estimate: StateEstimate, setpoint: Setpoint, dt: float
) -> LandedState:
    """Return the state after a tick of dt [s]; `resting_height` is world z at rest on the ground [m]."""
    height, speed = estimate.position_world[2] - resting_height, estimate.velocity_world[2]
    setpoint_height, setpoint_speed = setpoint.position_world[2] - resting_height, setpoint.velocity_world[2]
    if landed.name == ON_GROUND:
        return LandedState(FLYING if setpoint_height > 1e-6 or setpoint_speed > 0.0 else ON_GROUND, 0.0)
    if setpoint_height >= CUT_HEIGHT or setpoint_speed > 0.0:
        return LandedState(FLYING if setpoint_height >= CUT_HEIGHT and setpoint_speed > 0.0 else landed.name, 0.0)
    if landed.name == LANDED:
        return landed
    waiting = landed.waiting + dt if abs(speed) < LANDED_SPEED and height < LANDED_HEIGHT_ERROR else 0.0
    return LandedState(LANDED if height < CUT_HEIGHT or waiting > LANDED_TIME else FLYING, waiting)
