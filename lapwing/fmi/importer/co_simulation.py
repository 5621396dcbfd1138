"""FMU for co-simulation, which integrates its own states. Used in the process of the FMU.

A step that ends early continues after the FMU's event.
"""

import ctypes
import os
from typing import Any

import numpy as np

from lapwing.fmi.importer import stepping
from lapwing.fmi.importer.pipe_polling import LOOKS
from lapwing.fmi.importer.stepping import UPDATES, WARNING, Channel, FmuCalls
from lapwing.fmi.importer.variable_group import Group
from lapwing.kernels.cell import Cell
from lapwing.kernels.native_calls import address_of, poll_entry

DISCARD = 2  # FMI status
LAST_SUCCESSFUL_TIME, TERMINATED = 2, 3  # kinds of status in FMI 2.0


class CoSimulation:
    """Instantiated FMU: access to its variables, initialisation, steps and messages."""

    def __init__(self, spec: dict[str, Any], model: Any, fmu: Any, inputs: Any, outputs: Any):
        """Instantiate the FMU.

        Args:
            spec: `FmuConfig` of the FMU as a dictionary.
            model: FMPy's model description.
            fmu: FMPy's instance of the FMU.
            inputs: array of doubles with the values of the inputs.
            outputs: array of doubles that receives the outputs.
        """
        self.is_3 = spec["version"] == 3
        self._spec, self._fmu = spec, fmu
        self._event_mode = self.is_3 and bool(model.coSimulation.hasEventMode)
        self._messages: list[str] = []
        self._instantiate()
        component = fmu.component
        address = component if isinstance(component, int) else address_of(component)
        self.component = ctypes.c_void_p(address)
        self._set_groups = self._groups("Set", [element for _, _, element, _ in spec["inputs"]], inputs)
        self._get_groups = self._groups("Get", [element for _, _, element, _ in spec["outputs"]], outputs)
        events = "EnterEventMode", "UpdateDiscreteStates", "EnterStepMode"
        enter, update, leave = (address_of(self.function(name)) if self._event_mode else 0 for name in events)
        self._flags, self._times = np.zeros(8, np.uint8), np.full(4, np.nan)
        self._inputs = np.frombuffer(inputs, np.int64) if len(inputs) else np.zeros(0, np.int64)
        self._former = np.zeros_like(self._inputs)
        self._calls = Cell(
            FmuCalls(
                component=address, do_step=address_of(self.function("DoStep")), enter_event_mode=enter,
                update_discrete_states=update, enter_step_mode=leave, is_3=self.is_3, event_mode=self._event_mode,
                sets=_table(self._set_groups), gets=_table(self._get_groups), inputs=self._inputs, former=self._former,
                flags=self._flags, flags_address=self._flags.ctypes.data, times=self._times,
                times_address=self._times.ctypes.data,
            )
        )  # fmt: skip
        self.has_numbers_in_place = all(group.in_place for group in (*self._set_groups, *self._get_groups))

    def _instantiate(self) -> None:
        if self.is_3:
            self._fmu.instantiate(logMessage=self._log, eventModeUsed=self._event_mode, earlyReturnAllowed=True)
            return
        from fmpy import fmi2

        self._callbacks = fmi2.fmi2CallbackFunctions()
        ctypes.pointer(self._callbacks)[0] = fmi2.defaultCallbacks
        self._callbacks.logger = fmi2.fmi2CallbackLoggerTYPE(self._log)
        self._fmu.instantiate(callbacks=self._callbacks)

    def function(self, name: str) -> Any:
        """Return a function of the FMU: "DoStep" is fmi2DoStep or fmi3DoStep."""
        result = getattr(self._fmu.dll, f"fmi{3 if self.is_3 else 2}{name}")
        result.restype = ctypes.c_int
        return result

    def _groups(self, verb: str, elements: list[list[Any]], numbers: Any) -> list[Group]:
        entries: dict[str, list[tuple[int, list[Any]]]] = {}
        for index, element in enumerate(elements):
            entries.setdefault(element[2], []).append((index, element))
        return [Group(self, verb, kind, own, numbers) for kind, own in entries.items()]

    def initialise(self) -> None:
        """Set start values and inputs, initialise the FMU at time 0, and read the outputs."""
        texts = [(element, value) for element, value in self._spec["start"] if isinstance(value, str)]
        for (_, reference, kind, *_), value in texts:
            if kind == "Binary":
                self._fmu.setBinary([reference], [bytes.fromhex(value)])
            else:
                self._fmu.setString([reference], [value])
        start = [each for each in self._spec["start"] if not isinstance(each[1], str)]
        values = (ctypes.c_double * len(start))(*(value for _, value in start))
        for group in self._groups("Set", [element for element, _ in start], values):
            if group.partial:
                self._check("get", group.fill())
            self._check("set", group.set())
        if not self.is_3:
            self._fmu.setupExperiment(startTime=0.0)
        self._fmu.enterInitializationMode()
        for group in self._set_groups:
            if group.partial:
                self._check("get", group.fill())
        for group in self._set_groups:
            self._check("set", group.set())
        self._former[:] = self._inputs
        self._fmu.exitInitializationMode()
        if self._event_mode:
            self._update_discrete_states()
            self._check("enterStepMode", self.function("EnterStepMode")(self.component))
        self._get_outputs()

    def _update_discrete_states(self) -> None:
        """Update discrete states until they converge, after the initialisation."""
        again, terminate, *others = [ctypes.c_bool() for _ in range(5)]
        function, at = self.function("UpdateDiscreteStates"), ctypes.c_double()
        for _ in range(UPDATES):
            results = (ctypes.byref(each) for each in (again, terminate, *others))
            self._check("updateDiscreteStates", function(self.component, *results, ctypes.byref(at)))
            if terminate.value:
                self._times[3] = 0.0
            if terminate.value or not again.value:
                return
        self._finish(stepping.UNSETTLED, 0)

    def advance(self, time: float, step: float) -> None:
        """Set inputs at `time`, step the FMU by `step` [s], and read the outputs."""
        for group in self._set_groups:
            group.convert()
        self._finish(*stepping.step_once(self._calls, time, step))
        for group in self._get_groups:
            group.copy_out()

    def serve(self, channel: Cell) -> None:
        """Answer requests in compiled code. Return without sending outputs if the FMU has ended the simulation.

        Args:
            channel: cell of a `stepping.Channel`.

        Raises:
            ValueError: the FMU reports an error.
        """
        result, status = stepping.serve(self._calls, channel)
        while result == stepping.INTERRUPTED:
            result, status = stepping.serve(self._calls, channel)
        if result == stepping.CLOSED:
            os._exit(0)  # the run is over; foreign code is not called
        self._finish(result, status)

    def _finish(self, result: int, status: int) -> None:
        """Handle the result of a step. Raise ValueError if it failed."""
        if (
            result == stepping.DO_STEP
            and status == DISCARD
            and not self.is_3
            and self._fmu.getBooleanStatus(TERMINATED)
        ):
            self._times[3] = self._fmu.getRealStatus(LAST_SUCCESSFUL_TIME)
            self._get_outputs()
        elif result in stepping.FUNCTIONS:
            self._check(stepping.FUNCTIONS[result], status)
        elif result == stepping.ENDED:
            raise ValueError(f"requested the end of the simulation (t = {self._times[3]:g} s)")
        elif result == stepping.UNSETTLED:
            raise ValueError(f"the discrete states do not converge in {UPDATES} updates")
        elif result == stepping.STUCK:
            raise ValueError(f"doStep does not advance beyond t = {self._times[2]:g} s")
        elif result == stepping.MANY:
            raise ValueError(f"doStep ended early {UPDATES} times in one step")

    def _get_outputs(self) -> None:
        for group in self._get_groups:
            self._check("get", group.get())

    def _check(self, function: str, status: int) -> None:
        """Raise ValueError with the last message of the FMU if a function failed."""
        if status > WARNING:
            last = f": {' '.join(self._messages[-1].split())}" if self._messages else ""
            raise ValueError(f"{function} failed with status {status}{last}")

    def _log(self, *arguments: Any) -> None:
        """Store the message of a callback of either version of FMI, its last argument."""
        self._messages[:] = [(arguments[-1] or b"").decode(errors="replace")]


def channel(requests: int, replies: int, request: bytearray, reply: bytearray) -> Cell:
    """Return the channel of `CoSimulation.serve`: file descriptors, and the bytes of a request and a reply."""
    libc, received = ctypes.CDLL(None), np.zeros(1, np.int64)
    numbers, answer = (np.frombuffer(each, np.float64) for each in (request, reply))
    places = numbers.ctypes.data, answer.ctypes.data
    functions = map(address_of, (libc.poll, libc.read, libc.write))
    entry = poll_entry(requests)
    return Cell(
        Channel(requests, replies, numbers, answer, *places, received, entry, entry.ctypes.data, LOOKS, *functions)
    )


def _table(groups: list[Group]) -> np.ndarray:
    """Return the arguments of the calls that set or get groups."""
    rows = [
        (address_of(g.function), ctypes.addressof(g.references), len(g.references), ctypes.addressof(g.values))
        for g in groups
    ]
    sizes = [len(g.values) for g in groups]
    return np.column_stack([np.array(rows, np.int64).reshape(-1, 4), np.array(sizes, np.int64)])
