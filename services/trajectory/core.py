"""The trajectory, compiled: the reference at every tick."""

from typing import Any, NamedTuple

from cosim.part import GO_ON, Received
from dynamics.kernel import leaf
from services.common.ports import Reference
from services.trajectory import piece


class TrajectoryPath(NamedTuple):
    """A compiled trajectory."""

    path: piece.Parameters
    final: int  # the first phase after which none ends in the air
    interval: float  # [s] a tick


@leaf
def step(p: TrajectoryPath, s: Any, tick: int, inputs: tuple[Received, ...]) -> tuple[Any, tuple[Reference], int]:
    """The reference at `tick`; it has no state."""
    r = piece.evaluate(p.path, tick * p.interval)
    return s, (
        Reference(
            r.position_world, r.velocity_world, r.acceleration_world, r.yaw, r.yaw_rate, r.phase, r.phase >= p.final,
            p.path.phase_release[r.phase] > 0.0,
        ),
    ), GO_ON  # fmt: skip
