"""Python block of a user-defined controller, called at its rate while the motors run."""

from collections.abc import Callable
from types import ModuleType
from typing import Any

from lapwing.cosim.config.user_module import FAULTS, blame
from lapwing.cosim.diagram.tick_schedule import LATCHED, Port
from lapwing.cosim.run_errors import LockStepError
from lapwing.kernels import python_function
from lapwing.services.autopilot.block import FLIGHT, NO_TRAJECTORY, ORDER
from lapwing.services.autopilot.custom.controller_output import CONTROLLER_OUTPUT, motors_off, parse_controller_output
from lapwing.services.autopilot.custom.periodic import PeriodicBlock
from lapwing.services.autopilot.land_detector import FLYING, INITIAL_LANDED_STATE, LandedState, update_landed_state
from lapwing.services.autopilot.service_config import CustomCode
from lapwing.services.common import ports
from lapwing.services.common.controller_api import VehicleModel

_update_landed_state = python_function(update_landed_state)


class PythonControllerBlock(PeriodicBlock):
    """Calls the controller and writes its output to the port `controller_output`."""

    name = "autopilot.controller"

    def __init__(
        self, code: CustomCode, module: ModuleType, construct: Callable[[], Any], reference: str, vehicle: VehicleModel
    ):
        """Create the block; the controller is constructed at every take-off.

        Args:
            code: name and period.
            module: module of the class.
            construct: constructor without arguments.
            reference: port of the trajectory, or `NO_TRAJECTORY`.
            vehicle: vehicle parameters.
        """
        self.outputs = (Port(CONTROLLER_OUTPUT, motors_off(len(vehicle.rotor_positions_body)), LATCHED),)
        self._no_voltage = self.outputs[0].like.volts
        self._code, self._module, self._construct = code, module, construct
        self._reference, self._resting_height = reference, vehicle.resting_height
        self._controller: Any = None

    def _call_user_code(self, tick: int) -> None:
        graph = self._graph
        estimate, order = graph.latest(ports.ESTIMATE, tick), graph.latest(ORDER, tick)
        follows = order.follow and self._reference != NO_TRAJECTORY
        setpoint = graph.latest(self._reference, tick) if follows else order.setpoint
        landed = INITIAL_LANDED_STATE
        if tick > 0:
            landed = LandedState(graph.latest(FLIGHT, tick - 1).landed_state, 0.0)
        if landed.name != FLYING or order.restart_at == tick:
            self._controller = None
            previous = INITIAL_LANDED_STATE if order.restart_at == tick else landed
            landed = _update_landed_state(previous, self._resting_height, estimate, setpoint, graph.setup.interval)
        if landed.name != FLYING:
            return
        time = tick * graph.setup.interval
        try:
            self._controller = self._controller or self._construct()
            output = parse_controller_output(self._controller.step(time, estimate, setpoint), self._no_voltage)
        except FAULTS as error:
            cause = blame(error, self._module)
            raise LockStepError(f"controller {self._code.name}: {cause} at t = {time:.3f} s") from error
        graph.put(CONTROLLER_OUTPUT, tick, output)
