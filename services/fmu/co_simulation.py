"""Co-simulation: the FMU integrates itself. Steps that end early go on after the FMU's event."""

import ctypes
from typing import Any

from lapwing.services.fmu.instance import DISCARD, UPDATES, FmuInstance

LAST_SUCCESSFUL_TIME, TERMINATED = 2, 3  # kinds of status in FMI 2.0


class CoSimulation(FmuInstance):
    """An FMU that steps itself."""

    def __init__(self, spec: dict[str, Any], model: Any, fmu: Any, inputs: Any, outputs: Any):
        """See `FmuInstance`."""
        self._event_mode = spec["version"] == 3 and bool(model.coSimulation.hasEventMode)
        super().__init__(spec, model, fmu, inputs, outputs)
        self._do_step = self.function("DoStep")
        if self._event_mode:
            self._enter_event_mode, self._enter_step_mode = map(self.function, ("EnterEventMode", "EnterStepMode"))
        self._time, self._size, self._reached = (ctypes.c_double() for _ in range(3))
        flags = [ctypes.c_bool() for _ in range(3)]
        self._event_needed, self._terminate, self._early = flags
        begin = self.component, self._time, self._size
        results = [*map(ctypes.byref, flags), ctypes.byref(self._reached)]
        self._arguments = (*begin, ctypes.c_bool(True), *results) if self.is_3 else (*begin, ctypes.c_int(1))

    def instantiate_options(self) -> dict[str, Any]:
        """Return the permission to end steps early at events."""
        return {"eventModeUsed": self._event_mode, "earlyReturnAllowed": True}

    def after_initialisation(self) -> None:
        """Settle the discrete states, and enter step mode."""
        if self._event_mode:
            self.update_discrete_states(0.0)
            self.call(self._enter_step_mode)

    def advance(self, time: float, step: float) -> None:
        """Set inputs at `time`, and step the FMU by `step` [s]."""
        if not self._event_mode:
            self.set_inputs()
        elif self.inputs_changed:
            self._event(time, True)
        if not self.is_3:
            self._step2(time, step)
            return
        stop, at = time + step, time
        for _ in range(UPDATES):
            reached = self._step3(at, stop - at)
            if self._event_mode and self._event_needed.value:
                self._event(reached)
            if reached >= stop - 1e-9 * step or self.ended is not None:
                return
            if reached <= at and not self._event_needed.value:
                raise ValueError(f"doStep does not get beyond t = {at:g} s")
            at = reached
        raise ValueError(f"doStep ended early {UPDATES} times between t = {time:g} s and {stop:g} s")

    def _call(self, time: float, step: float) -> int:
        self._time.value, self._size.value = time, step
        return int(self._do_step(*self._arguments))

    def _step2(self, time: float, step: float) -> None:
        status = self._call(time, step)
        if status == DISCARD and self.fmu.getBooleanStatus(TERMINATED):
            self.ended = self.fmu.getRealStatus(LAST_SUCCESSFUL_TIME)
            return
        self.check("doStep", status)

    def _step3(self, time: float, step: float) -> float:
        """Return the time that a step reaches."""
        self.check("doStep", self._call(time, step))
        reached = self._reached.value if self._early.value else time + step
        if self._terminate.value:
            self.ended = reached
        return reached

    def _event(self, time: float, with_inputs: bool = False) -> None:
        self.call(self._enter_event_mode)
        if with_inputs:
            self.set_inputs()
        self.update_discrete_states(time)
        self.call(self._enter_step_mode)
