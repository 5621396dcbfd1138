"""An instantiated FMU: access to its variables, initialisation and messages. It lives in the process of the FMU."""

import ctypes
import math
from typing import Any, NamedTuple

WARNING, DISCARD = 1, 2  # statuses of FMI; WARNING is the highest that is no failure
UPDATES = 1000  # of discrete states at one time, before an FMU counts as one that never settles


class _Type(NamedTuple):
    suffix: str  # of the functions that set and get it
    c_type: Any
    lowest: float  # whole numbers it holds; 0 and 0 of other types
    highest: float


def _integer(suffix: str, c_type: Any, signed: bool = True) -> _Type:
    bits = 8 * ctypes.sizeof(c_type)
    limits = (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1) if signed else (0, 2**bits - 1)
    return _Type(suffix, c_type, *limits)


_FMI2 = {
    "Real": _Type("Real", ctypes.c_double, 0, 0),
    "Integer": _integer("Integer", ctypes.c_int),
    "Enumeration": _integer("Integer", ctypes.c_int),
    "Boolean": _Type("Boolean", ctypes.c_int, 0, 0),
}
_FMI3 = {
    "Float64": _Type("Float64", ctypes.c_double, 0, 0),
    "Float32": _Type("Float32", ctypes.c_float, 0, 0),
    **{f"Int{n}": _integer(f"Int{n}", getattr(ctypes, f"c_int{n}")) for n in (8, 16, 32, 64)},
    **{f"UInt{n}": _integer(f"UInt{n}", getattr(ctypes, f"c_uint{n}"), signed=False) for n in (8, 16, 32, 64)},
    "Enumeration": _integer("Int64", ctypes.c_int64),
    "Boolean": _Type("Boolean", ctypes.c_bool, 0, 0),
}


class Group:
    """Variables of one type, set or read by one call."""

    def __init__(
        self, instance: "FmuInstance", verb: str, kind: str, elements: list[tuple[int, list[Any]]], numbers: Any
    ):
        """Lay out the values of all elements of the variables.

        Args:
            instance: of the FMU.
            verb: "Set" or "Get".
            kind: type of the variables.
            elements: (index in `numbers`, `Element`).
            numbers: array of doubles, which the values of the variables come from or go to.
        """
        given = (_FMI3 if instance.is_3 else _FMI2)[kind]
        begins: dict[int, int] = {}
        names: dict[int, str] = {}
        total = 0
        for _, (name, reference, _, _, size) in elements:
            if reference not in begins:
                begins[reference], names[reference] = total, name
                total += size
        self.indices = [index for index, _ in elements]
        self.places = [begins[reference] + index for _, (_, reference, _, index, _) in elements]
        self.names = [element[0] for _, element in elements]
        self.partial = len(set(self.places)) < total
        self._numbers = numbers
        # Doubles side by side are passed to the FMU in place, other numbers side by side by one slice
        begin = self.indices[0]
        is_dense = self.places == [*range(total)] and self.indices == [*range(begin, begin + total)]
        self._slice = slice(begin, begin + total) if is_dense else None
        self._in_place = is_dense and given.c_type is ctypes.c_double
        values = given.c_type * total
        self.values = (
            values.from_buffer(numbers, begin * ctypes.sizeof(ctypes.c_double)) if self._in_place else values()
        )
        self._former: list[float] = []  # the numbers that `values` has
        self._is_real = kind in ("Real", "Float64", "Float32")
        self._is_boolean = kind == "Boolean"
        self._limits = given.lowest, given.highest
        references = (ctypes.c_uint32 * len(begins))(*begins)
        sizes = (ctypes.c_size_t(total),) if instance.is_3 else ()
        self.arguments = (instance.component, references, ctypes.c_size_t(len(begins)), self.values, *sizes)
        self.function = instance.function(verb + given.suffix)
        self._read = instance.function("Get" + given.suffix)

    def fill(self) -> int:
        """Read all elements, for arrays of which only some are set. Return the status."""
        return int(self._read(*self.arguments))

    def set(self) -> int:
        """Set the variables to the numbers. Return the status.

        Raises:
            ValueError: a number does not fit the type.
        """
        if not self._in_place:
            numbers = self._numbers[self._slice or slice(None)]
            if numbers != self._former:
                self._convert()
                self._former = numbers
        return int(self.function(*self.arguments))

    def get(self) -> int:
        """Read the numbers from the variables. Return the status."""
        status = int(self.function(*self.arguments))
        if self._in_place:
            return status
        if self._slice:
            self._numbers[self._slice] = self.values[:]
        else:
            for index, place in zip(self.indices, self.places, strict=True):
                self._numbers[index] = self.values[place]
        return status

    def _convert(self) -> None:
        for index, place, name in zip(self.indices, self.places, self.names, strict=True):
            value = self._numbers[index]
            if self._is_real:
                self.values[place] = value
            elif self._is_boolean:
                self.values[place] = value != 0.0
            elif math.isfinite(value) and self._limits[0] <= int(value) <= self._limits[1]:
                self.values[place] = int(value)
            else:
                raise ValueError(f"{name} cannot be set to {value:g}; its type has whole numbers in {self._limits}")


class FmuInstance:
    """An instantiated FMU; the subclasses advance its time."""

    def __init__(self, spec: dict[str, Any], model: Any, fmu: Any, inputs: Any, outputs: Any):
        """Instantiate the FMU.

        Args:
            spec: the FMU's `FmuConfig` as a dictionary.
            model: FMPy's model description.
            fmu: FMPy's object of the FMU.
            inputs: array of doubles that the inputs are set to.
            outputs: array of doubles that receives the outputs.
        """
        self.spec, self.model, self.fmu, self.inputs = spec, model, fmu, inputs
        self.is_3 = spec["version"] == 3
        self.messages: list[str] = []
        self.ended: float | None = None  # [s] at which the FMU asked to end the simulation
        self._instantiate()
        component = fmu.component
        is_number = isinstance(component, int)
        self.address = component if is_number else int(ctypes.cast(component, ctypes.c_void_p).value or 0)
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
            self.fmu.instantiate(logMessage=self._log3, **self.instantiate_options())
            return
        from fmpy import fmi2

        self._callbacks = fmi2.fmi2CallbackFunctions()
        ctypes.pointer(self._callbacks)[0] = fmi2.defaultCallbacks
        self._callbacks.logger = fmi2.fmi2CallbackLoggerTYPE(self._log2)
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
            entries.setdefault(element[2], []).append((index, element))
        return [Group(self, verb, kind, own, numbers) for kind, own in entries.items()]

    def initialise(self) -> None:
        """Set start values and inputs, and initialise the FMU at time 0."""
        start = self.spec["start"]
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

    def after_initialisation(self) -> None:
        """Leave the mode in which the FMU is after its initialisation."""

    def advance(self, time: float, step: float) -> None:
        """Set inputs at `time`, and advance the FMU by `step` [s]."""
        raise NotImplementedError

    @property
    def inputs_changed(self) -> bool:
        """True if the inputs differ from the ones that the FMU has."""
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
        """Update discrete states in event mode until they settle. Return the time of the next time event [s], or inf.

        Raises:
            ValueError: they never settle.
        """
        for _ in range(UPDATES):
            again, terminate, has_time, at = self._update()
            if terminate:
                self.ended = time
            if terminate or not again:
                return at if has_time else math.inf
        raise ValueError(f"the discrete states do not settle in {UPDATES} updates")

    def _update(self) -> tuple[bool, bool, bool, float]:
        """Return (another update is needed, the FMU asks to end, it has a time event, time of the event [s])."""
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

    def _log3(self, environment: Any, status: int, category: bytes, message: bytes) -> None:
        self.messages[:] = [(message or b"").decode(errors="replace")]

    def _log2(self, environment: Any, name: bytes, status: int, category: bytes, message: bytes) -> None:
        self.messages[:] = [(message or b"").decode(errors="replace")]
