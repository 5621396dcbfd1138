"""Blocks of user-defined controllers and estimators.

A controller is called at its rate while the motors run; an estimator at its rate, and its latest estimate is output at
every tick.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from types import ModuleType
from typing import Any, NamedTuple

from lapwing.cosim.config.user_module import FAULTS, blame
from lapwing.cosim.diagram.block_diagram import BlockDiagram
from lapwing.cosim.diagram.compiled_block import CONTINUE, WAKE_PYTHON, Block, InputSample
from lapwing.cosim.diagram.tick_schedule import LATCHED, InputPort, Port
from lapwing.cosim.run_errors import LockStepError
from lapwing.kernels import always_inline
from lapwing.kernels.cell import Cell
from lapwing.services.autopilot.block import ORDER, Controller
from lapwing.services.autopilot.commander_wakeup import WakeupParameters, wakeup_due
from lapwing.services.autopilot.controller_parameters import lift, moments
from lapwing.services.autopilot.custom import block
from lapwing.services.autopilot.custom.block import CustomController, PythonControllerProxy
from lapwing.services.autopilot.custom.controller_output import CONTROLLER_OUTPUT, no_output, parse_controller_output
from lapwing.services.autopilot.custom.estimator_api import validate_estimate
from lapwing.services.autopilot.custom.user_code_loader import (
    CONTROLLER,
    ESTIMATOR,
    compile_controller,
    constructor,
    is_compiled,
)
from lapwing.services.autopilot.land_detector import FLYING
from lapwing.services.autopilot.landing_block import LANDING
from lapwing.services.autopilot.service_config import AutopilotConfig, CustomCode
from lapwing.services.common import ports
from lapwing.services.common.controller_api import VehicleModel
from lapwing.services.common.ports import StateEstimate
from lapwing.services.common.user_code import load_object


class PeriodicBlock(ABC):
    """Block that calls user code at multiples of its period."""

    _code: CustomCode

    def bind(self, diagram: BlockDiagram) -> None:
        """Store the diagram."""
        self._diagram = diagram

    def on_tick(self, tick: int) -> int:
        """Call the user code if it is due at `tick`. Return the tick of the next wake-up."""
        every = self._code.every
        if tick % every == 0:
            self._call_user_code(tick)
        return tick - tick % every + every

    @abstractmethod
    def _call_user_code(self, tick: int) -> None:
        """Call the user code with the inputs at `tick` and write its output."""


class PythonControllerBlock(PeriodicBlock):
    """Calls the controller and writes its output to the port `controller_output`."""

    name = "autopilot.controller"

    def __init__(self, code: CustomCode, module: ModuleType, construct: Callable[[], Any], vehicle: VehicleModel):
        """Create the block; the controller is constructed at every take-off.

        Args:
            code: name and period.
            module: module of the class.
            construct: constructor without arguments.
            vehicle: vehicle parameters.
        """
        self.outputs = (Port(CONTROLLER_OUTPUT, no_output(len(vehicle.rotor_positions_body)), LATCHED),)
        self._no_voltage = self.outputs[0].example.volts
        self._code, self._module, self._construct = code, module, construct
        self._controller: Any = None  # None unless the motors run

    def _call_user_code(self, tick: int) -> None:
        diagram = self._diagram
        estimate, landing = diagram.latest(ports.ESTIMATE, tick), diagram.latest(LANDING, tick)
        if landing.landed_state != FLYING or diagram.latest(ORDER, tick).restart_at == tick:
            self._controller = None
        if landing.landed_state != FLYING:
            return
        time = tick * diagram.config.interval
        try:
            self._controller = self._controller or self._construct()
            output = parse_controller_output(self._controller.step(time, estimate, landing.setpoint), self._no_voltage)
        except FAULTS as error:
            cause = blame(error, self._module)
            raise LockStepError(f"controller {self._code.name}: {cause} at t = {time:.3f} s") from error
        diagram.put(CONTROLLER_OUTPUT, tick, output)


HELD = "held_estimate"  # port within the autopilot


class PythonEstimatorBlock(PeriodicBlock):
    """Calls the estimator with new readings and writes its estimate to the port `held_estimate`."""

    name = "autopilot.estimator"
    outputs = (Port(HELD, StateEstimate(), LATCHED),)

    def __init__(
        self, code: CustomCode, module: ModuleType, construct: Callable[[], Any], sensors: dict[str, int]
    ) -> None:
        """Create the block; `sensors` has the ticks between two readings by port."""
        self._code, self._module, self._construct, self._sensors = code, module, construct, sensors
        self.inputs = tuple(InputPort(name) for name in sensors)
        self._estimator: Any = None

    def _call_user_code(self, tick: int) -> None:
        new = {name: period for name, period in self._sensors.items() if tick % period < self._code.every}
        readings = {name: self._diagram.latest(name, tick) for name in new}
        time = tick * self._diagram.config.interval
        try:
            self._estimator = self._estimator or self._construct()
            estimate = validate_estimate(self._estimator.step(time, readings))
        except FAULTS as error:
            cause = blame(error, self._module)
            raise LockStepError(f"estimator {self._code.name}: {cause} at t = {time:.3f} s") from error
        self._diagram.put(HELD, tick, estimate)


class HeldEstimate(NamedTuple):
    """Parameters of the block."""

    wakeup: WakeupParameters


@always_inline
def step(p: HeldEstimate, s: Any, tick: int, inputs: tuple[InputSample, ...]) -> tuple[Any, tuple[StateEstimate], int]:
    """Output the latest estimate; the state is unused."""
    held, battery, flight = inputs
    due = wakeup_due(p.wakeup, tick, held.value.health, battery, flight)
    return s, (held.value,), WAKE_PYTHON if due else CONTINUE


def controller_blocks(
    name: str,
    texts: Mapping[str, str],
    config: AutopilotConfig,
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
        inputs: estimate, commander output, battery and landing.
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
    python_block = PythonControllerBlock(code, module, construct, vehicle)
    p = CustomController(common, PythonControllerProxy(0.0), 0.0, code.every, *per_control, vehicle.voltage_max)
    return [python_block, Block(name, p, Cell(block.start(p)), (*inputs, InputPort(CONTROLLER_OUTPUT)), outputs)]


def estimator_blocks(
    name: str,
    texts: Mapping[str, str],
    config: AutopilotConfig,
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
