"""Compiled block `hold` for a firmware that follows the scene's trajectory."""

from typing import NamedTuple

from lapwing.cosim.diagram.compiled_block import CONTINUE, InputSample
from lapwing.kernels import always_inline
from lapwing.services.common.firmware import hold
from lapwing.services.common.firmware.hold import HeldState, Hold
from lapwing.services.common.ports import AutopilotStatus, Setpoint


class HoldReference(NamedTuple):
    """Parameters of the block; its inputs are command, battery and trajectory."""

    hold: Hold


@always_inline
def step(p: HoldReference, s: HeldState, tick: int, inputs: tuple[InputSample, ...]) -> tuple[HeldState, tuple, int]:
    """Return the motor command, the status and the reference at `tick`."""
    after, (motors, status), _ = hold.step(p.hold, s, tick, inputs)
    reference: Setpoint = inputs[2].value
    return after, (motors, AutopilotStatus(reference.phase, *status[1:]), reference), CONTINUE
