"""Compiled trajectory block: the reference at every tick."""

from typing import Any, NamedTuple

from lapwing.cosim.diagram.compiled_block import CONTINUE, InputSample
from lapwing.kernels import always_inline
from lapwing.services.common.ports import Reference
from lapwing.services.trajectory import polynomial_piece


class TrajectoryPath(NamedTuple):
    """Parameters of the block."""

    path: polynomial_piece.Parameters
    final: int  # index of the first phase after which none ends in the air
    interval: float  # [s] length of a tick


@always_inline
def step(p: TrajectoryPath, s: Any, tick: int, inputs: tuple[InputSample, ...]) -> tuple[Any, tuple[Reference], int]:
    """Evaluate the reference at `tick`; the state is unused."""
    r = polynomial_piece.evaluate(p.path, tick * p.interval)
    return s, (
        Reference(
            r.position_world, r.velocity_world, r.acceleration_world, r.yaw, r.yaw_rate, r.phase, r.phase >= p.final,
            p.path.phase_release[r.phase] > 0.0,
        ),
    ), CONTINUE  # fmt: skip
