"""Compiled trajectory block: the setpoint at every tick."""

from typing import Any, NamedTuple

from lapwing.cosim.diagram.compiled_block import CONTINUE, InputSample
from lapwing.kernels import always_inline
from lapwing.services.common.ports import Setpoint
from lapwing.services.trajectory import polynomial_piece


class TrajectoryPath(NamedTuple):
    """Parameters of the block."""

    path: polynomial_piece.Parameters
    final: int  # index of the first phase after which none ends in the air
    interval: float  # [s] length of a tick


@always_inline
def step(p: TrajectoryPath, s: Any, tick: int, inputs: tuple[InputSample, ...]) -> tuple[Any, tuple[Setpoint], int]:
    """Evaluate the setpoint at `tick`; the state is unused."""
    return s, (polynomial_piece.evaluate(p.path, tick * p.interval, p.final),), CONTINUE
