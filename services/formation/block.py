"""The formation's control, compiled: every body's state in, thrusts and moments out."""

from typing import Any, NamedTuple

from lapwing.cosim.diagram.compiled_block import CONTINUE, InputSample
from lapwing.dynamics.vehicles.cooperative_control import formation_control
from lapwing.dynamics.vehicles.cooperative_load import CooperativeLoadParameters, CooperativeLoadState
from lapwing.kernels import always_inline
from lapwing.kernels.codegen import map_index
from lapwing.services.common.ports import RotorWrenches
from lapwing.services.formation import links


class FormationLaw(NamedTuple):
    """The formation with its control law as the drive."""

    formation: CooperativeLoadParameters
    interval: float  # [s] a tick


@always_inline
def step(p: FormationLaw, s: Any, tick: int, inputs: tuple[InputSample, ...]) -> tuple[Any, tuple[RotorWrenches], int]:
    """The command of a tick; the load comes first among the bodies, the quadrotors next. It has no state."""
    b = inputs[0].value
    load, velocity = b.position_world[0], b.velocity_world[0]
    attitudes, omegas = b.attitude[1:], b.omega_body[1:]
    found = map_index(links.link, attitudes, load, velocity, b.position_world[1:], b.velocity_world[1:])
    x = CooperativeLoadState(load, velocity, attitudes, omegas, found)
    given = formation_control(p.formation, tick * p.interval, x)
    return s, (RotorWrenches(given.thrust, given.moment_body),), CONTINUE
