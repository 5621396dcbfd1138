"""Instantiated FMU: access to its variables, initialisation and messages. Used in the process of the FMU."""

import ctypes
import math
from typing import Any

from lapwing.kernels.native_calls import address_of
from lapwing.services.fmu.service_config import CLOCK
from lapwing.services.fmu.stepping import UPDATES, WARNING
from lapwing.services.fmu.variable_group import Group

DISCARD = 2  # FMI status


class FmuInstance:
    """Instantiated FMU; subclasses advance its time."""

    def __init__(self, spec: dict[str, Any], model: Any, fmu: Any, inputs: Any, outputs: Any):
        """Instantiate the FMU.

        Args:
            spec: `FmuConfig` of the FMU as a dictionary.
            model: FMPy's model description.
            fmu: FMPy's instance of the FMU.
            inputs: array of doubles with the values of the inputs.
            outputs: array of doubles that receives the outputs.
        """
        self.spec, self.model, self.fmu, self.inputs = spec, model, fmu, inputs
        self.is_3 = spec["version"] == 3
        self.messages: list[str] = []
        self.ended: float | None = None  # [s] time at which the FMU requested the end of the simulation
        self._instantiate()
        component = fmu.component
        is_number = isinstance(component, int)
        self.address = component if is_number else address_of(component)
        self.component = ctypes.c_void_p(self.address)
        if self.is_3:
            self._update_function = self.function("UpdateDiscreteStates")
        self._update_flags, self._event_time = [ctypes.c_bool() for _ in range(5)], ctypes.c_double()
        self._update_results = [*map(ctypes.byref, self._update_flags), ctypes.byref(self._event_time)]
        self.set_groups = self._groups("Set", [element for _, _, element, _ in spec["inputs"]], inputs)
        self.get_groups = self._groups("Get", [element for _, _, element, _ in spec["outputs"]], outputs)
        self._last_inputs = b""

    def _instantiate(self) -> None:
        if self.is_3:
            self.fmu.instantiate(logMessage=self._log, **self.instantiate_options())
            return
        from fmpy import fmi2

        self._callbacks = fmi2.fmi2CallbackFunctions()
        ctypes.pointer(self._callbacks)[0] = fmi2.defaultCallbacks
        self._callbacks.logger = fmi2.fmi2CallbackLoggerTYPE(self._log)
        self.fmu.instantiate(callbacks=self._callbacks)

    def instantiate_options(self) -> dict[str, Any]:
        """Return further arguments of the instantiation in FMI 3.0."""
        return {}

    def function(self, name: str) -> Any:
        """Return a function of the FMU: "DoStep" is fmi2DoStep or fmi3DoStep."""
        result = getattr(self.fmu.dll, f"fmi{3 if self.is_3 else 2}{name}")
        result.restype = ctypes.c_int
        return result

    def _groups(self, verb: str, elements: list[list[Any]], numbers: Any) -> list[Group]:
        entries: dict[str, list[tuple[int, list[Any]]]] = {}
        for index, element in enumerate(elements):
            if element[2] == CLOCK:
                continue  # a subclass activates it
            entries.setdefault(element[2], []).append((index, element))
        return [Group(self, verb, kind, own, numbers) for kind, own in entries.items()]

    def initialise(self) -> None:
        """Set start values and inputs, initialise the FMU at time 0, and read the outputs."""
        texts = [(element, value) for element, value in self.spec["start"] if isinstance(value, str)]
        for (_, reference, kind, *_), value in texts:
            if kind == "Binary":
                self.fmu.setBinary([reference], [bytes.fromhex(value)])
            else:
                self.fmu.setString([reference], [value])
        start = [each for each in self.spec["start"] if not isinstance(each[1], str)]
        values = (ctypes.c_double * len(start))(*(value for _, value in start))
        for group in self._groups("Set", [element for element, _ in start], values):
            if group.partial:
                self.check("get", group.fill())
            self.check("set", group.set())
        if not self.is_3:
            self.fmu.setupExperiment(startTime=0.0)
        self.fmu.enterInitializationMode()
        for group in self.set_groups:
            if group.partial:
                self.check("get", group.fill())
        self.set_inputs()
        self.fmu.exitInitializationMode()
        self.after_initialisation()
        self.get_outputs()

    def after_initialisation(self) -> None:
        """Leave the mode that follows the initialisation of the FMU."""

    def advance(self, time: float, step: float) -> None:
        """Set inputs at `time`, advance the FMU by `step` [s], and read the outputs."""
        raise NotImplementedError

    @property
    def inputs_changed(self) -> bool:
        """Return True if the inputs differ from those that were set last."""
        return bytes(self.inputs) != self._last_inputs

    def set_inputs(self) -> None:
        """Set all inputs."""
        for group in self.set_groups:
            self.check("set", group.set())
        self._last_inputs = bytes(self.inputs)

    def get_outputs(self) -> None:
        """Read all outputs."""
        for group in self.get_groups:
            self.check("get", group.get())

    def update_discrete_states(self, time: float) -> float:
        """Update discrete states in event mode until they converge. Return the time of the next time event [s], or inf.

        Raises:
            ValueError: they do not converge.
        """
        for _ in range(UPDATES):
            again, terminate, has_time, at = self._update()
            if terminate:
                self.ended = time
            if terminate or not again:
                return at if has_time else math.inf
        raise ValueError(f"the discrete states do not converge in {UPDATES} updates")

    def _update(self) -> tuple[bool, bool, bool, float]:
        """Return (another update is needed, the FMU requests the end, it has a time event, time of the event [s])."""
        if not self.is_3:
            again, terminate, _, _, has_time, at = self.fmu.newDiscreteStates()
            return again, terminate, has_time, at
        self.call(self._update_function, *self._update_results)
        again, terminate, _, _, has_time = self._update_flags
        return again.value, terminate.value, has_time.value, self._event_time.value

    def call(self, function: Any, *arguments: Any) -> None:
        """Call a function of the FMU on its instance.

        Raises:
            ValueError: it reports an error.
        """
        if (status := function(self.component, *arguments)) > WARNING:
            name = function.__name__[len("fmi3") :]
            self.check(name[0].lower() + name[1:], status)

    def check(self, function: str, status: int) -> None:
        """Raise ValueError with the last message of the FMU if a function failed."""
        if status > WARNING:
            last = f": {' '.join(self.messages[-1].split())}" if self.messages else ""
            raise ValueError(f"{function} failed with status {status}{last}")

    def _log(self, *arguments: Any) -> None:
        """Store the message of a callback of either version of FMI, its last argument."""
        self.messages[:] = [(arguments[-1] or b"").decode(errors="replace")]
