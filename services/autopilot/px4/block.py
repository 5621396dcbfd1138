"""Controller block of the PX4 cascade, between land detector and motors."""

from typing import Any, NamedTuple

from lapwing.cosim.diagram.compiled_block import CONTINUE, InputSample
from lapwing.kernels import always_inline, python_function
from lapwing.kernels.cell import read
from lapwing.services.autopilot import motor_failure
from lapwing.services.autopilot.block import Controller, block_outputs, start_step
from lapwing.services.autopilot.control import Command
from lapwing.services.autopilot.land_detector import (
    FLYING,
    INITIAL_LANDED_STATE,
    LANDED,
    LandedState,
    update_landed_state,
)
from lapwing.services.autopilot.mixer import zero_thrust
from lapwing.services.autopilot.px4 import law


class Px4Controller(NamedTuple):
    """Parameters of the block."""

    common: Controller
    law: Any  # cell of `law.Parameters`


class Px4State(NamedTuple):
    """State of the block."""

    landed_state: LandedState
    law: law.State
    failure_detector: motor_failure.State
    still_from: int  # [tick]
    charge: float  # charge of the battery, fraction; NaN: unknown


def start(p: Px4Controller) -> Px4State:
    """Return the initial state."""
    detector = python_function(motor_failure.start)(read(p.common.failure_detector))
    return Px4State(INITIAL_LANDED_STATE, law.START, detector, 0, float("nan"))


@always_inline
def step(p: Px4Controller, s: Px4State, tick: int, inputs: tuple[InputSample, ...]) -> tuple[Px4State, tuple, int]:
    """Compute the motor command at `tick`."""
    c = p.common
    i = start_step(c, s, tick, inputs)
    e, setpoint = i.estimate, i.setpoint
    landed = INITIAL_LANDED_STATE if i.restarts else s.landed_state
    landed = update_landed_state(landed, c.law.value.resting_height, e, setpoint, c.interval)
    if landed.name == FLYING:
        control_state, command = law.step(p.law.value, s.law, c.interval, e, setpoint, i.failure_detector.failed)
    else:
        off = zero_thrust(c.law.value.shares[0])
        control_state, command = law.start(e), Command(off, off, 0.0, 0.0, setpoint.yaw, landed.name == LANDED)
    detector, outputs = block_outputs(c, i, landed.name, command)
    return Px4State(landed, control_state, detector, i.still_from, i.charge), outputs, CONTINUE
