"""Model exchange: Lapwing integrates the equations of the FMU, locates state events, and meets time events exactly."""

import ctypes
import math
from typing import Any

from lapwing.dynamics import integrators
from lapwing.kernels.native_calls import address_of
from lapwing.services.fmu.derivatives import FmuFunctions, advance_states
from lapwing.services.fmu.instance import FmuInstance
from lapwing.services.fmu.stepping import UPDATES

WIDTH = 1e-12  # [s] length of the interval that contains a state event
SLACK = 1e-9  # relative to a step: a time event this close to its end belongs to the step


class ModelExchange(FmuInstance):
    """FMU whose states Lapwing integrates."""

    def __init__(self, spec: dict[str, Any], model: Any, fmu: Any, inputs: Any, outputs: Any):
        """See `FmuInstance`."""
        super().__init__(spec, model, fmu, inputs, outputs)
        self._needs_completed = bool(model.modelExchange.needsCompletedIntegratorStep)
        self._method = integrators.get(spec["integrator"]).Method()
        self._status = ctypes.c_int64()
        modes = "EnterEventMode", "EnterContinuousTimeMode"
        self._enter_event_mode, self._enter_continuous_time_mode = map(self.function, modes)
        derivatives = "GetContinuousStateDerivatives" if self.is_3 else "GetDerivatives"
        names = "SetTime", "SetContinuousStates", derivatives
        set_time, set_states, get = (address_of(self.function(name)) for name in names)
        self._functions = FmuFunctions(set_time, set_states, get, self.address, ctypes.addressof(self._status))

    def after_initialisation(self) -> None:
        """Update the discrete states until they converge, and enter continuous-time mode."""
        self._next_event = self.update_discrete_states(0.0)
        self.call(self._enter_continuous_time_mode)
        states, indicators = self.model.numberOfContinuousStates, self.model.numberOfEventIndicators
        if self.is_3:
            states, indicators = self.fmu.getNumberOfContinuousStates(), self.fmu.getNumberOfEventIndicators()
        self._states, self._indicators = (ctypes.c_double * states)(), (ctypes.c_double * indicators)()

    def advance(self, time: float, step: float) -> None:
        """Set inputs at `time` (an event if they changed), integrate over `step` [s], and read the outputs."""
        if self.ended is not None:
            raise ValueError(f"requested the end of the simulation (t = {self.ended:g} s)")
        self._integrate_over(time, step)
        self.get_outputs()

    def _integrate_over(self, time: float, step: float) -> None:
        end, slack = time + step, SLACK * step
        if self.inputs_changed:
            self._event(time, True)
        for _ in range(UPDATES):
            if self.ended is not None:
                return
            if self._next_event <= time:
                self._event(time)
            elif time >= end - slack and self._next_event > end + slack:
                return
            else:
                time = self._to_event_or(time, self._next_event if self._next_event <= end + slack else end)
        raise ValueError(f"more than {UPDATES} events between t = {end - step:g} s and {end:g} s")

    def _to_event_or(self, begin: float, end: float) -> float:
        """Integrate to a state event, or to `end`, and handle the event. Return the time reached [s]."""
        x = self._read(self._states, "GetContinuousStates")
        positive = self._positive()
        after = self._integrate(begin, x, end)
        event = self._positive() != positive
        if event:
            low, high = begin, end
            while high - low > max(WIDTH, 4.0 * math.ulp(high)):
                middle = 0.5 * (low + high)
                states = self._integrate(begin, x, middle)
                if self._positive() != positive:
                    high, after = middle, states
                else:
                    low = middle
            end = high
            self._place(end, after)
        if self._needs_completed:
            entered, terminate = self.fmu.completedIntegratorStep()
            event = event or entered
            if terminate:
                self.ended = end
        if event:
            self._event(end)
        return end

    def _integrate(self, begin: float, x: tuple[float, ...], end: float) -> tuple[float, ...]:
        """Return the states at `end`, and set them in the FMU.

        Raises:
            ValueError: the FMU reports an error, or a state is not finite.
        """
        self._status.value = 0
        if x:
            x = advance_states(self._method, self.spec["accuracy"], self._functions, begin, x, end)
            if not all(map(math.isfinite, x)):
                self.check("getDerivatives", self._status.value)
                raise ValueError("a continuous state is not finite")
        self._place(end, x)
        return x

    def _place(self, time: float, x: tuple[float, ...]) -> None:
        self.fmu.setTime(time)
        if x:
            self._states[:] = x
            self.fmu.setContinuousStates(self._states, len(x))

    def _read(self, values: Any, name: str) -> tuple[float, ...]:
        if len(values):
            getattr(self.fmu, name[0].lower() + name[1:])(values, len(values))
        return tuple(values)

    def _positive(self) -> tuple[bool, ...]:
        return tuple(value > 0.0 for value in self._read(self._indicators, "GetEventIndicators"))

    def _event(self, time: float, with_inputs: bool = False) -> None:
        self.call(self._enter_event_mode)
        if with_inputs:
            self.set_inputs()
        self._next_event = self.update_discrete_states(time)
        self.call(self._enter_continuous_time_mode)
