"""Compiled block before the controllers: land detector and final approach."""

from typing import Any, NamedTuple

from lapwing.cosim.diagram.compiled_block import CONTINUE, InputSample
from lapwing.dynamics.vector import ZERO
from lapwing.kernels import always_inline
from lapwing.services.autopilot.approach import NO_APPROACH, Approach, move, update_approach
from lapwing.services.autopilot.land_detector import FLYING, INITIAL_LANDED_STATE, LandedState, update_landed_state
from lapwing.services.common.ports import PerRotor, Setpoint, StateEstimate

LANDING = "landing"  # port within the autopilot


class Landing(NamedTuple):
    """Output of the block."""

    setpoint: Setpoint = Setpoint()  # of the trajectory or the commander, changed near the ground
    landed_state: int = INITIAL_LANDED_STATE.name  # ON_GROUND, FLYING or LANDED
    power: float = 1.0  # fraction of the commanded thrust that the motors get
    approaches: bool = False  # the setpoint's height and vertical speed are not those of the trajectory


class LandingParameters(NamedTuple):
    """Parameters of the block."""

    detector: Any  # cell of `land_detector.Parameters`
    interval: float  # [s] length of a tick


class LandingState(NamedTuple):
    """State of the block."""

    landed: LandedState
    approach: Approach


START = LandingState(INITIAL_LANDED_STATE, NO_APPROACH)


@always_inline
def total(thrust: PerRotor) -> float:
    """Return the sum of the rotors' thrusts [N]."""
    result = 0.0
    for f in thrust:
        result += f
    return result


@always_inline
def settle(e: StateEstimate, setpoint: Setpoint) -> Setpoint:
    """Return the setpoint in contact: level, at the vehicle's present place, height and speed.

    The thrust is then that of hover, of which the motors get a falling share. The feet hold the place, and an impact
    disturbs the estimate for a second: a correction of height or speed would lift or drop the vehicle, that of the
    place would tip it on a slope. If it was no contact, the vehicle falls and flies on.
    """
    return move(setpoint, e.position_world, e.velocity_world, ZERO)


@always_inline
def step(
    p: LandingParameters, s: LandingState, tick: int, inputs: tuple[InputSample, ...]
) -> tuple[LandingState, tuple[Landing], int]:
    """Update the landed state and the setpoint at `tick`; inputs: estimate, order, reference, last motor command."""
    e, order, d = inputs[0].value, inputs[1].value, p.detector.value
    setpoint = inputs[2].value if order.follow else order.setpoint
    landed, approach = s.landed, s.approach
    if order.restart_at == tick:
        landed, approach = INITIAL_LANDED_STATE, NO_APPROACH
    if d.thresholds.cut_height <= 0.0 and landed.name == FLYING:
        approach, setpoint = update_approach(d, approach, setpoint, e.position_world[2], p.interval)
    else:
        approach = NO_APPROACH
    thrust = total(inputs[3].value.thrust) if inputs[3].due else 0.0
    landed = update_landed_state(d, landed, e, setpoint, thrust, p.interval)
    if landed.power < 1.0:
        setpoint = settle(e, setpoint)
    return (
        LandingState(landed, approach),
        (Landing(setpoint, landed.name, landed.power, approach.active),),
        CONTINUE,
    )
