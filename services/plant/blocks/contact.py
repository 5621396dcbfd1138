"""Output of the ground force on each foot of a multirotor, if the scene has `rates.contact_forces`."""

from typing import Any, NamedTuple

from lapwing.cosim.diagram.compiled_block import CONTINUE, InputSample
from lapwing.dynamics.effects import _hooks as hooks
from lapwing.dynamics.vector import first, second
from lapwing.dynamics.vehicles.multirotor_equations import MultirotorParameters, motion_of
from lapwing.kernels import always_inline
from lapwing.kernels.codegen import map_tuple
from lapwing.services.common.ports import ContactForces


class ContactView(NamedTuple):
    """Parameters of the block."""

    vehicle: MultirotorParameters


@always_inline
def step(p: ContactView, s: Any, tick: int, inputs: tuple[InputSample, ...]) -> tuple[Any, tuple[ContactForces], int]:
    """Output position and ground force of each contact point at `tick`."""
    vehicle, state = p.vehicle, s.vehicle
    pushes = hooks.all_contact_forces(vehicle.effects, state.memory, motion_of(vehicle.layout, state.motion))
    return s, (ContactForces(map_tuple(first, 0.0, pushes, pushes), map_tuple(second, 0.0, pushes, pushes)),), CONTINUE
