"""Output of a multirotor's slung load, with the force of its cable."""

from typing import Any, NamedTuple

from lapwing.cosim.diagram.compiled_block import CONTINUE, InputSample
from lapwing.dynamics.lie.quaternion import NO_ROTATION
from lapwing.dynamics.vehicles.multirotor_equations import RotorLayout
from lapwing.dynamics.vehicles.multirotor_slung import cable_force
from lapwing.kernels import always_inline
from lapwing.services.common.ports import BodyMotions


class SlungLoadView(NamedTuple):
    """Parameters of the block."""

    layout: RotorLayout


@always_inline
def step(p: SlungLoadView, s: Any, tick: int, inputs: tuple[InputSample, ...]) -> tuple[Any, tuple[BodyMotions], int]:
    """Output the motion of the load at `tick`, a point without rotation, and the force of the cable on it."""
    x, zero = s.vehicle.motion, ((0.0, 0.0, 0.0),)
    force = (cable_force(p.layout, x),)
    return s, (BodyMotions((x.load_position,), (NO_ROTATION,), (x.load_velocity,), zero, force, zero),), CONTINUE
