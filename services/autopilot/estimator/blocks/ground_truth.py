"""Ground truth as an estimate without error."""

from typing import Any, NamedTuple

from lapwing.cosim.diagram.compiled_block import CONTINUE, WAKE_PYTHON, InputSample
from lapwing.dynamics.vector import ZERO
from lapwing.kernels import always_inline
from lapwing.services.autopilot.commander_wakeup import WakeupParameters, wakeup_due
from lapwing.services.common.ports import StateEstimate


class TrueEstimate(NamedTuple):
    """Parameters of the block."""

    wakeup: WakeupParameters


@always_inline
def step(p: TrueEstimate, s: Any, tick: int, inputs: tuple[InputSample, ...]) -> tuple[Any, tuple[StateEstimate], int]:
    """Output the true state at `tick`; the block's state is unused."""
    truth, battery, flight = inputs
    x = truth.value
    e = StateEstimate(
        x.position_world, x.attitude, x.velocity_world, x.omega_body, x.acceleration_world,
        ZERO, ZERO, ZERO, ZERO, ZERO, 0, 0,
    )  # fmt: skip
    due = wakeup_due(p.wakeup, tick, 0, battery, flight)
    return s, (e,), WAKE_PYTHON if due else CONTINUE
