"""Reset of the inertial biases at a switch to another inertial measurement unit."""

from typing import NamedTuple

from lapwing.cosim.diagram.compiled_block import CONTINUE, InputSample
from lapwing.kernels import always_inline
from lapwing.services.autopilot import estimator
from lapwing.services.autopilot.estimator import Estimator
from lapwing.services.autopilot.estimator.blocks.navigation_state import NavigationState


class ImuSwitch(NamedTuple):
    """Parameters of the block."""

    filter: Estimator


@always_inline
def step(
    p: ImuSwitch, s: NavigationState, tick: int, inputs: tuple[InputSample, ...]
) -> tuple[NavigationState, tuple[()], int]:
    """Reset the biases at the tick of a switch."""
    x = s.filter
    if s.started and inputs[0].value.switched:
        x = estimator.reset_imu_biases(p.filter, x)
    return NavigationState(s.started, x), (), CONTINUE
