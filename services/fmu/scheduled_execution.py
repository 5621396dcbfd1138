"""Scheduled execution: Lapwing activates the model partitions of an FMU at the ticks of their clocks."""

import ctypes
import math
from operator import attrgetter
from pathlib import Path
from typing import Any

from lapwing.kernels.native_calls import address_of
from lapwing.services.fmu.clocks import COUNTDOWN, DESCRIPTION, PERIODIC, TRIGGERED, input_clocks
from lapwing.services.fmu.instance import FmuInstance
from lapwing.services.fmu.service_config import CLOCK
from lapwing.services.fmu.stepping import UPDATES

SLACK = 1e-9  # [s] tolerance between a tick and the computed time of a clock
CHANGED = 2  # fmi3IntervalChanged


class ScheduledExecution(FmuInstance):
    """FMU with model partitions that run one after another, without preemption."""

    def __init__(self, spec: dict[str, Any], model: Any, fmu: Any, inputs: Any, outputs: Any):
        """See `FmuInstance`."""
        super().__init__(spec, model, fmu, inputs, outputs)
        address = address_of(self.function("ActivateModelPartition"))
        # not FMPy's method, which has an argument from before the release of FMI 3.0
        self._run = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p, ctypes.c_uint32, ctypes.c_double)(address)
        clocks = sorted(input_clocks(Path(spec["folder"], DESCRIPTION).read_bytes()), key=attrgetter("priority"))
        self._due = {clock: clock.shift if clock.variability in PERIODIC else math.inf for clock in clocks}
        self._ticks = dict.fromkeys(clocks, 0)  # tick counts of periodic clocks, so that no time errors accumulate
        by_reference = {clock.reference: clock for clock in clocks if clock.variability == TRIGGERED}
        self._triggers = [(index, by_reference[reference]) for index, reference in _clocks_of(spec["inputs"])]
        self._outputs, self._output_clocks = outputs, _clocks_of(spec["outputs"])
        self._countdowns = [clock for clock in clocks if clock.variability == COUNTDOWN]
        n = len(self._countdowns)
        self._references = (ctypes.c_uint32 * n)(*(clock.reference for clock in self._countdowns))
        self._intervals, self._qualifiers = (ctypes.c_double * n)(), (ctypes.c_int * n)()

    def after_initialisation(self) -> None:
        """Activate the clocks that are due at time 0."""
        self._start_countdowns(0.0)
        self._activate(0.0)

    def advance(self, time: float, step: float) -> None:
        """Set the inputs, activate the partitions that are due at time + step, and read the outputs."""
        for group in self.set_groups:
            self.check("set", group.set())
        self._activate(time + step)
        self.get_outputs()

    def _activate(self, now: float) -> None:
        for index, _ in self._output_clocks:
            self._outputs[index] = 0.0
        for index, clock in self._triggers:
            self._due[clock] = now if self.inputs[index] else math.inf
        for _ in range(UPDATES):
            pending = [clock for clock, due in self._due.items() if due <= now + SLACK]
            if not pending:
                return
            clock = pending[0]
            if self._due[clock] < now - SLACK:
                raise ValueError(f"clock {clock.name} is due at t = {self._due[clock]:.9g} s, between two ticks")
            self._ticks[clock] += 1
            periodic = clock.variability in PERIODIC
            self._due[clock] = clock.shift + self._ticks[clock] * clock.interval if periodic else math.inf
            self.check("activateModelPartition", self._run(self.address, clock.reference, now))
            self._start_countdowns(now)
            for index, reference in self._output_clocks:
                if self.fmu.getClock([reference])[0]:
                    self._outputs[index] = 1.0
        raise ValueError(f"clocks tick more than {UPDATES} times at t = {now:.9g} s")

    def _start_countdowns(self, now: float) -> None:
        """Read the intervals of countdown clocks that the FMU has started."""
        if not self._countdowns:
            return
        self.fmu.getIntervalDecimal(self._references, self._intervals, self._qualifiers)
        for clock, interval, qualifier in zip(self._countdowns, self._intervals, self._qualifiers, strict=True):
            if qualifier == CHANGED:
                self._due[clock] = now + interval


def _clocks_of(connections: list[Any]) -> list[tuple[int, int]]:
    """Return index and value reference of each connection with a clock."""
    return [(k, element[1]) for k, (_, _, element, _) in enumerate(connections) if element[2] == CLOCK]
