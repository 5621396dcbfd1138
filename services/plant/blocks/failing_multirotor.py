"""Plant of a five-body multirotor in a communication step in which propellers fail."""

from typing import NamedTuple

from lapwing.cosim.diagram.compiled_block import InputSample
from lapwing.dynamics.vehicles.propeller_failures import Failure, advance_through
from lapwing.kernels import always_inline
from lapwing.services.common.ports import BatteryReading, TrueState
from lapwing.services.plant.blocks.multirotor import MultirotorPlant, MultirotorPlantState, apply_inputs, output


class FailingMultirotorPlant(NamedTuple):
    """Parameters of the block: the plant before the failures, and the failures."""

    core: MultirotorPlant
    failures: tuple[Failure, ...]  # failures in this communication step, ascending in time


@always_inline
def step(
    p: FailingMultirotorPlant, s: MultirotorPlantState, tick: int, inputs: tuple[InputSample, ...]
) -> tuple[MultirotorPlantState, tuple[TrueState, BatteryReading], int]:
    """Advance through the failures to `tick`, which is positive. See `multirotor.step` for inputs."""
    core = p.core
    vehicle, command = apply_inputs(core, s, inputs)
    vehicle = advance_through(
        core.method, core.vehicle, p.failures, core.key, tick - 1, vehicle, command, core.step, core.steps
    )
    return output(core, p.failures[len(p.failures) - 1].vehicle, s, tick, vehicle, command, inputs[1])
