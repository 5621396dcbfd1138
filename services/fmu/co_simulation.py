"""Co-simulation: the FMU integrates its own states. A step that ends early continues after the FMU's event."""

import ctypes
import os
from typing import Any

import numpy as np

from lapwing.kernels.cell import Cell
from lapwing.kernels.native_calls import address_of, poll_entry
from lapwing.services.fmu import stepping
from lapwing.services.fmu.instance import DISCARD, FmuInstance
from lapwing.services.fmu.pipe_polling import LOOKS
from lapwing.services.fmu.stepping import UPDATES, Channel, FmuCalls
from lapwing.services.fmu.variable_group import Group

LAST_SUCCESSFUL_TIME, TERMINATED = 2, 3  # kinds of status in FMI 2.0


class CoSimulation(FmuInstance):
    """FMU with its own integrator."""

    def __init__(self, spec: dict[str, Any], model: Any, fmu: Any, inputs: Any, outputs: Any):
        """See `FmuInstance`."""
        self._event_mode = spec["version"] == 3 and bool(model.coSimulation.hasEventMode)
        super().__init__(spec, model, fmu, inputs, outputs)
        events = "EnterEventMode", "UpdateDiscreteStates", "EnterStepMode"
        enter, update, leave = (address_of(self.function(name)) if self._event_mode else 0 for name in events)
        self._flags, self._times = np.zeros(8, np.uint8), np.full(4, np.nan)
        bits = np.frombuffer(inputs, np.int64) if len(inputs) else np.zeros(0, np.int64)
        self._former = np.zeros_like(bits)
        self._calls = Cell(
            FmuCalls(
                component=self.address, do_step=address_of(self.function("DoStep")), enter_event_mode=enter,
                update_discrete_states=update, enter_step_mode=leave, is_3=self.is_3, event_mode=self._event_mode,
                sets=_table(self.set_groups), gets=_table(self.get_groups), inputs=bits, former=self._former,
                flags=self._flags, flags_address=self._flags.ctypes.data, times=self._times,
                times_address=self._times.ctypes.data,
            )
        )  # fmt: skip
        self.has_numbers_in_place = all(group.in_place for group in (*self.set_groups, *self.get_groups))

    def instantiate_options(self) -> dict[str, Any]:
        """Return the permission to end steps early at events."""
        return {"eventModeUsed": self._event_mode, "earlyReturnAllowed": True}

    def after_initialisation(self) -> None:
        """Update the discrete states until they converge, and enter step mode."""
        self._former[:] = np.frombuffer(self.inputs, np.int64) if len(self.inputs) else 0
        if self._event_mode:
            self.update_discrete_states(0.0)
            self.call(self.function("EnterStepMode"))
            if self.ended is not None:
                self._times[3] = self.ended

    def advance(self, time: float, step: float) -> None:
        """Set inputs at `time`, step the FMU by `step` [s], and read the outputs."""
        for group in self.set_groups:
            group.convert()
        self._finish(*stepping.step_once(self._calls, time, step))
        for group in self.get_groups:
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
        if result == stepping.DO_STEP and status == DISCARD and not self.is_3 and self.fmu.getBooleanStatus(TERMINATED):
            self._times[3] = self.fmu.getRealStatus(LAST_SUCCESSFUL_TIME)
            self.get_outputs()
        elif result in stepping.FUNCTIONS:
            self.check(stepping.FUNCTIONS[result], status)
        elif result == stepping.ENDED:
            raise ValueError(f"requested the end of the simulation (t = {self._times[3]:g} s)")
        elif result == stepping.UNSETTLED:
            raise ValueError(f"the discrete states do not converge in {UPDATES} updates")
        elif result == stepping.STUCK:
            raise ValueError(f"doStep does not advance beyond t = {self._times[2]:g} s")
        elif result == stepping.MANY:
            raise ValueError(f"doStep ended early {UPDATES} times in one step")


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
