"""Blocks of a user-defined estimator: Python code at its rate, then its latest estimate at every tick."""

from collections.abc import Callable
from types import ModuleType
from typing import Any, NamedTuple

from lapwing.cosim.config.user_module import FAULTS, blame
from lapwing.cosim.diagram.compiled_block import CONTINUE, WAKE_PYTHON, InputSample
from lapwing.cosim.diagram.tick_schedule import LATCHED, InputPort, Port
from lapwing.cosim.run_errors import LockStepError
from lapwing.kernels import always_inline
from lapwing.services.autopilot.commander_wakeup import WakeupParameters, wakeup_due
from lapwing.services.autopilot.custom.periodic import PeriodicBlock
from lapwing.services.autopilot.service_config import CustomCode
from lapwing.services.common.estimator_api import validate_estimate
from lapwing.services.common.ports import StateEstimate

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
        readings = {name: self._graph.latest(name, tick) for name in new}
        time = tick * self._graph.setup.interval
        try:
            self._estimator = self._estimator or self._construct()
            estimate = validate_estimate(self._estimator.step(time, readings))
        except FAULTS as error:
            cause = blame(error, self._module)
            raise LockStepError(f"estimator {self._code.name}: {cause} at t = {time:.3f} s") from error
        self._graph.put(HELD, tick, estimate)


class HeldEstimate(NamedTuple):
    """Parameters of the block."""

    wakeup: WakeupParameters


@always_inline
def step(p: HeldEstimate, s: Any, tick: int, inputs: tuple[InputSample, ...]) -> tuple[Any, tuple[StateEstimate], int]:
    """Output the latest estimate; the state is unused."""
    held, battery, flight = inputs
    due = wakeup_due(p.wakeup, tick, held.value.health, battery, flight)
    return s, (held.value,), WAKE_PYTHON if due else CONTINUE
