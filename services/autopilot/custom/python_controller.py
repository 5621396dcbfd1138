"""Python block of a user-defined controller, called at its rate while the motors run."""

from collections.abc import Callable
from types import ModuleType
from typing import Any

from lapwing.cosim.config.user_module import FAULTS, blame
from lapwing.cosim.diagram.tick_schedule import LATCHED, Port
from lapwing.cosim.run_errors import LockStepError
from lapwing.kernels import python_function
from lapwing.services.autopilot.block import FLIGHT, NO_TRAJECTORY, ORDER, estimate_of, setpoint_of
from lapwing.services.autopilot.custom.controller_output import DEMAND, demand, off
from lapwing.services.autopilot.custom.periodic import PeriodicPart
from lapwing.services.autopilot.land_detector import FLYING, INITIAL_STAGE, LandedState, advance_stage
from lapwing.services.autopilot.service_config import CustomCode
from lapwing.services.common import ports
from lapwing.services.common.controller_api import VehicleModel

_advance_stage, _estimate_of = python_function(advance_stage), python_function(estimate_of)
_setpoint_of = python_function(setpoint_of)


class PythonControllerBlock(PeriodicPart):
    """Calls the controller and writes its output to the port `demand`."""

    name = "autopilot.controller"

    def __init__(
        self,
        code: CustomCode,
        module: ModuleType,
        construct: Callable[[], Any],
        reference: str,
        vehicle: VehicleModel,
    ):
        """Create the block; the controller is constructed at every take-off.

        Args:
            code: name and period.
            module: module of the class.
            construct: constructor without arguments.
            reference: port of the trajectory, or `NO_TRAJECTORY`.
            vehicle: vehicle parameters.
        """
        self.outputs = (Port(DEMAND, off(len(vehicle.rotor_positions_body)), LATCHED),)
        self._none = self.outputs[0].like.volts
        self._code, self._module, self._construct = code, module, construct
        self._reference, self._resting_height = reference, vehicle.resting_height
        self._controller: Any = None

    def _ask(self, tick: int) -> None:
        graph = self._graph
        estimate, order = graph.latest(ports.ESTIMATE, tick), graph.latest(ORDER, tick)
        follows = order.follow and self._reference != NO_TRAJECTORY
        setpoint = graph.latest(self._reference, tick) if follows else order.reference
        stage = LandedState(graph.latest(FLIGHT, tick - 1).stage, 0.0) if tick > 0 else INITIAL_STAGE
        if stage.name != FLYING or order.restart_at == tick:
            self._controller = None
            before = INITIAL_STAGE if order.restart_at == tick else stage
            asked = _estimate_of(estimate), _setpoint_of(setpoint)
            stage = _advance_stage(before, self._resting_height, *asked, graph.setup.interval)
        if stage.name != FLYING:
            return
        time = tick * graph.setup.interval
        try:
            self._controller = self._controller or self._construct()
            found = demand(self._controller.step(time, estimate, setpoint), self._none)
        except FAULTS as error:
            raise LockStepError(f"{self._said(error)} at t = {time:.3f} s") from error
        graph.put(DEMAND, tick, found)

    def _said(self, error: BaseException) -> str:
        return f"controller {self._code.name}: {blame(error, self._module)}"
