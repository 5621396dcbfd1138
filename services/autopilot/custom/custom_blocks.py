"""Blocks of user-defined controllers and estimators."""

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
from lapwing.services.autopilot.custom.controller_output import CONTROLLER_OUTPUT
from lapwing.services.autopilot.custom.python_controller import PythonControllerBlock
from lapwing.services.autopilot.custom.python_estimator import HELD, HeldEstimate, PythonEstimatorBlock
from lapwing.services.autopilot.custom.user_code_loader import (
    CONTROLLER,
    ESTIMATOR,
    compile_controller,
    constructor,
    is_compiled,
)
from lapwing.services.autopilot.service_config import AutopilotSetup
from lapwing.services.common.user_code import load_object


def controller_blocks(
    name: str,
    texts: Mapping[str, str],
    config: AutopilotSetup,
    common: Controller,
    inputs: tuple[InputPort, ...],
    outputs: tuple[Port, ...],
) -> list[Any]:
    """Return the Python block of the controller, if it is not compiled, and the block that outputs the motor command.

    Args:
        name: name of the output block.
        texts: module texts of the run configuration.
        config: configuration of the autopilot.
        common: parameters shared with the cascaded PID.
        inputs: estimate, commander output, battery and reference.
        outputs: outputs of the output block.
    """
    code, vehicle = config.controller, config.vehicle
    assert code is not None
    assert vehicle is not None
    module, user_code = load_object(CONTROLLER, code.name, texts)
    per_control = lift(config.airframe), moments(config.airframe)
    if is_compiled(user_code):
        parameters, start = compile_controller(module, user_code, vehicle, code.options)
        p = CustomController(common, parameters, start, code.every, *per_control, vehicle.voltage_max)
        return [Block(name, p, Cell(block.start(p)), inputs, outputs, trusted=False)]
    construct = constructor(CONTROLLER, module, user_code, vehicle, code.options)
    python_block = PythonControllerBlock(code, module, construct, inputs[3].port, vehicle)
    p = CustomController(common, PythonControllerProxy(0.0), 0.0, code.every, *per_control, vehicle.voltage_max)
    return [python_block, Block(name, p, Cell(block.start(p)), (*inputs, InputPort(CONTROLLER_OUTPUT)), outputs)]


def estimator_blocks(
    name: str,
    texts: Mapping[str, str],
    config: AutopilotSetup,
    wakeup: WakeupParameters,
    sensors: dict[str, int],
    inputs: tuple[InputPort, ...],
    estimate: Port,
) -> list[Any]:
    """Return the Python block of the estimator and the block that outputs its estimate at every tick.

    Args:
        name: name of the output block.
        texts: module texts of the run configuration.
        config: configuration of the autopilot.
        wakeup: wake-up parameters of the commander.
        sensors: ticks between two readings, by port.
        inputs: battery and flight.
        estimate: port of the estimate.
    """
    code, vehicle = config.own_estimator, config.vehicle
    assert code is not None
    assert vehicle is not None
    module, user_code = load_object(ESTIMATOR, code.name, texts)
    python_block = PythonEstimatorBlock(
        code, module, constructor(ESTIMATOR, module, user_code, vehicle, code.options), sensors
    )
    return [python_block, Block(name, HeldEstimate(wakeup), Cell(0.0), (InputPort(HELD), *inputs), (estimate,))]
