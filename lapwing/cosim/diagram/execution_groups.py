"""Execution groups: sets of blocks that are stepped tick by tick, independently of the other sets.

A vehicle that steps through a block of ticks alone stays in the processor's cache. If 32 vehicles alternate at every
tick, each step costs a tenth more (docs/reference/benchmarks.md). The results are bit-for-bit identical.
"""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from lapwing.cosim.diagram.compiled_block import CONTINUE, FINISHED, NON_FINITE, WAKE_PYTHON, BoundBlock, run, schedule
from lapwing.cosim.run_errors import LockStepError
from lapwing.kernels.cell import Cell


def independent_groups(parts: Sequence[Any]) -> list[list[int]]:
    """Return the numbers of the blocks of each group: those of each vehicle, or of all if one reads
    a port of another vehicle or an external port."""
    vehicles = [getattr(part, "vehicle", "") for part in parts]
    giver = {port.name: vehicle for part, vehicle in zip(parts, vehicles, strict=True) for port in part.outputs}
    for part, vehicle in zip(parts, vehicles, strict=True):
        if any(giver.get(i.port) != vehicle for i in getattr(part, "inputs", ())):
            return [list(range(len(parts)))]
    return [[k for k, other in enumerate(vehicles) if other == vehicle] for vehicle in dict.fromkeys(vehicles)]


class ExecutionGroup:
    """Parts that step together.

    Attributes:
        parts: their numbers in the graph, in their order.
        tick: the next.
        over: whether they have said that the tick before was the last.
    """

    def __init__(self, numbers: Sequence[int], parts: Sequence[Any], codes: Sequence[BoundBlock | None]):
        """Select the blocks `numbers` of a diagram, with their compiled code (None for Python blocks)."""
        self.parts, self.tick, self.finished = list(numbers), 0, False
        own = [parts[k] for k in numbers]
        every, vehicles = [getattr(part, "every", 1) for part in own], [getattr(part, "vehicle", "") for part in own]
        plan = schedule([codes[k] for k in numbers], every, vehicles)
        self._plan = plan._replace(done=np.append(plan.done, 1))  # the last: whether they may end
        self._cell = Cell(self._plan)  # the same arrays; a cell is handed over faster

    def advance(self, stop: int, on_tick: Callable[[int, int], int], failure: Callable[[int, int], Exception]) -> None:
        """Run up to before the tick `stop`, or until they are over.

        Args:
            stop: tick.
            on_tick: runs the Python block of a number at a tick; returns the tick of its next wake-up.
            failure: returns the error of a block whose state is invalid at a tick.
        """
        k = 0
        while not self.finished:
            self.tick, k, signal = run(self._cell, self.tick, k, stop)
            if signal == WAKE_PYTHON:
                self._plan.next[k] = max(on_tick(self.parts[k], self.tick), self.tick + 1)
                k += 1
            elif signal == NON_FINITE:
                raise failure(self.parts[k], self.tick)
            else:
                self.finished = signal == FINISHED
                if signal == CONTINUE:
                    return

    def run_past_end(
        self, stop: int, on_tick: Callable[[int, int], int], failure: Callable[[int, int], Exception]
    ) -> None:
        """Run to `stop` after the end, because other groups have not ended. See `advance` for arguments."""
        self._plan.done[-1] = self._plan.ended[0] = 0
        self.finished = False
        self.advance(stop, on_tick, failure)
        self.finished = True

    def finish(self) -> None:
        """Let the present tick be the last."""
        self._plan.ended[0] = 1

    def replace(self, part: int, code: BoundBlock) -> None:
        """Let other code step a part from now on."""
        k = self.parts.index(part)
        self._plan.function[k], self._plan.memory[k] = code.function, code.memory


def advance_groups(
    turns: Sequence[ExecutionGroup],
    stop: int,
    on_tick: Callable[[int, int], int],
    failure: Callable[[int, int], Exception],
) -> tuple[int, bool, LockStepError | None]:
    """Run all up to before the tick `stop`, or until the last of them is over; arguments as of
    `ExecutionGroup.advance`.

    Returns:
        The tick that all have come to, those that were over before the last one, too; whether the run is over; the
        first failure, which ends the run at its tick.
    """
    failed: LockStepError | None = None
    for turn in [turn for turn in turns if not turn.finished]:
        try:
            turn.advance(stop, on_tick, failure)
        except LockStepError as error:
            failed, stop = error, turn.tick
    if not any(turn.finished for turn in turns):
        return stop, False, failed
    ended = failed is None and all(turn.finished for turn in turns)
    if ended:
        stop = max(turn.tick for turn in turns)
    for turn in [turn for turn in turns if turn.finished and turn.tick < stop]:
        try:
            turn.run_past_end(stop, on_tick, failure)
        except LockStepError as error:
            failed, stop, ended = error, turn.tick, False
    return stop, ended, failed
