"""Effects of the other vehicles of a fleet on a multirotor, applied before it steps."""

from typing import Any, NamedTuple

from lapwing.cosim.diagram.compiled_block import CONTINUE, InputSample
from lapwing.dynamics.effects._vehicle_interaction import NeighbourState, all_interactions
from lapwing.dynamics.vehicles.multirotor_equations import MultirotorState
from lapwing.kernels import always_inline
from lapwing.kernels.codegen import map_index
from lapwing.services.plant.blocks.multirotor import MultirotorPlantState


class Interaction(NamedTuple):
    """Parameters of the block."""

    effects: tuple  # effects of the vehicle's plant
    interval: float  # [s] length of a tick


@always_inline
def _neighbour_state(inputs: tuple[InputSample, ...], i: int) -> NeighbourState:
    return inputs[i].value


@always_inline
def step(p: Interaction, s: MultirotorPlantState, tick: int, inputs: tuple[InputSample, ...]) -> tuple[Any, tuple, int]:
    """Update the plant's effects with the neighbours' states of the previous tick, its own state first."""
    vehicle = s.vehicle
    if inputs[0].due:
        others = map_index(_neighbour_state, inputs[1:], inputs[1:])
        memory = all_interactions(p.effects, vehicle.memory, inputs[0].value, others, p.interval)
        vehicle = MultirotorState(vehicle.motion, memory)
    return MultirotorPlantState(vehicle, s.last), (), CONTINUE
