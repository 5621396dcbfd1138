"""The parts of the graph that a controller or an estimator of the user's takes."""

from collections.abc import Mapping
from typing import Any

from lapwing.cosim.diagram.compiled_block import Block
from lapwing.cosim.diagram.tick_schedule import InputPort, Port
from lapwing.kernels.cell import Cell
from lapwing.services.autopilot.block import Controller
from lapwing.services.autopilot.commander_wakeup import WakeupParameters
from lapwing.services.autopilot.controller_parameters import lift, moments
from lapwing.services.autopilot.custom import block
from lapwing.services.autopilot.custom.block import CustomController, PythonControllerProxy
from lapwing.services.autopilot.custom.controller_output import DEMAND
from lapwing.services.autopilot.custom.python_controller import PythonControllerBlock
from lapwing.services.autopilot.custom.python_estimator import HELD, HeldEstimate, PythonEstimatorBlock
from lapwing.services.autopilot.custom.user_code_loader import CONTROLLER, ESTIMATOR, compiled, constructor, is_compiled
from lapwing.services.autopilot.service_config import AutopilotSetup
from lapwing.services.common.user_code import named


def controller_parts(
    name: str,
    texts: Mapping[str, str],
    given: AutopilotSetup,
    common: Controller,
    inputs: tuple[InputPort, ...],
    outputs: tuple[Port, ...],
) -> list[Any]:
    """The controller itself where it stays in Python, and the part from its demand to the motors.

    Args:
        name: of the latter.
        texts: of the modules that the set-up carries.
        given: the autopilot's set-up.
        common: what the cascaded PID has too.
        inputs: estimate, order, battery and reference.
        outputs: of the latter.
    """
    code, vehicle = given.controller, given.vehicle
    assert code is not None
    assert vehicle is not None
    module, found = named(CONTROLLER, code.name, texts)
    per_demand = lift(given.airframe), moments(given.airframe)
    if is_compiled(found):
        own, start = compiled(module, found, vehicle, code.options)
        p = CustomController(common, own, start, code.every, *per_demand, vehicle.voltage_max)
        return [Block(name, p, Cell(block.start(p)), inputs, outputs, trusted=False)]
    construct = constructor(CONTROLLER, module, found, vehicle, code.options)
    asked = PythonControllerBlock(code, module, construct, inputs[3].port, vehicle)
    p = CustomController(common, PythonControllerProxy(0.0), 0.0, code.every, *per_demand, vehicle.voltage_max)
    return [asked, Block(name, p, Cell(block.start(p)), (*inputs, InputPort(DEMAND)), outputs)]


def estimator_parts(
    name: str,
    texts: Mapping[str, str],
    given: AutopilotSetup,
    attention: WakeupParameters,
    sensors: dict[str, int],
    inputs: tuple[InputPort, ...],
    estimate: Port,
) -> list[Any]:
    """The estimator, and the part that gives its estimate at every tick.

    Args:
        name: of the latter.
        texts: of the modules that the set-up carries.
        given: the autopilot's set-up.
        attention: what calls the commander.
        sensors: ticks between two readings, by the sensor's port.
        inputs: battery and flight.
        estimate: port of the estimate.
    """
    code, vehicle = given.own_estimator, given.vehicle
    assert code is not None
    assert vehicle is not None
    module, found = named(ESTIMATOR, code.name, texts)
    asked = PythonEstimatorBlock(code, module, constructor(ESTIMATOR, module, found, vehicle, code.options), sensors)
    return [asked, Block(name, HeldEstimate(attention), Cell(0.0), (InputPort(HELD), *inputs), (estimate,))]
