"""Plant of quadrotors that carry a point mass by rigid links: thrusts and moments in, states of all bodies out."""

from typing import Any, NamedTuple

from lapwing.cosim.diagram.compiled_block import InputSample
from lapwing.dynamics.integrators import integrate_fixed
from lapwing.dynamics.lie.quaternion import NO_ROTATION
from lapwing.dynamics.vector import ZERO, Vec3
from lapwing.dynamics.vehicles.cooperative_load import (
    CooperativeLoadParameters,
    CooperativeLoadState,
    LiftCommand,
    quad_position,
    quad_velocity,
)
from lapwing.kernels import always_inline
from lapwing.kernels.codegen import map_index
from lapwing.kernels.state_tree import finite
from lapwing.services.common.ports import BodyMotions, RotorWrenches, TrueState
from lapwing.services.plant.blocks.termination import termination_status


class CooperativePlant(NamedTuple):
    """Parameters of the block: the formation and its integration."""

    formation: CooperativeLoadParameters  # its drive is replaced by the received command
    method: Any  # `Method()` of an integrator
    steps: int  # per tick
    step: float  # [s]
    interval: float  # [s] length of a tick
    last: int  # last tick of the run
    off: RotorWrenches  # output of the controller before its first command


@always_inline
def _zero(values: tuple, i: int) -> Vec3:
    return ZERO


@always_inline
def step(
    p: CooperativePlant, s: CooperativeLoadState, tick: int, inputs: tuple[InputSample, ...]
) -> tuple[CooperativeLoadState, tuple[TrueState, BodyMotions], int]:
    """Integrate to `tick` under the received command; the true state is that of the load."""
    g = p.formation
    lift = inputs[0].value if inputs[0].due else p.off
    g = CooperativeLoadParameters(
        g.quad_mass, g.quad_inertia, g.link_length, g.load_mass, g.gravity, LiftCommand(lift.thrust, lift.moment_body)
    )
    x = s
    if tick > 0:
        x = integrate_fixed(p.method, g, (tick - 1) * p.interval, x, p.step, p.steps)
    truth = TrueState(
        x.load_position, NO_ROTATION, x.load_velocity, ZERO, ZERO, (), (), (), (), (), (), ZERO, 0.0, False, ZERO
    )
    nothing = map_index(_zero, x.link, x.link)
    bodies = BodyMotions(
        (x.load_position,) + map_index(quad_position, x.link, g, x),  # noqa: RUF005 (compiled tuples have no unpacking)
        (NO_ROTATION,) + x.attitude,  # noqa: RUF005
        (x.load_velocity,) + map_index(quad_velocity, x.link, g, x),  # noqa: RUF005
        (ZERO,) + x.omega_body,  # noqa: RUF005
        (ZERO,) + nothing,  # noqa: RUF005
        (ZERO,) + nothing,  # noqa: RUF005
    )
    return x, (truth, bodies), termination_status(tick, p.last, finite(x))
