"""Who steps when: all parts of a graph tick by tick, or where nothing couples its vehicles one vehicle after the other.

A vehicle that goes through a page of ticks by itself stays in the processor's cache; where 32 take turns at every tick
each step costs a tenth more (docs/reference/benchmarks.md). What comes of it is the same to the bit.
"""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from lapwing.cosim.diagram.compiled_block import CONTINUE, FINISHED, NON_FINITE, WAKE_PYTHON, BoundBlock, run, schedule
from lapwing.cosim.run_errors import LockStepError
from lapwing.kernels.cell import Cell


def groups(parts: Sequence[Any]) -> list[list[int]]:
    """The numbers of the parts that step together: those of each vehicle, or of all where one takes what another or
    nobody here gives."""
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
        """Parts `numbers` of all parts of a graph, and their code, None of a part in Python."""
        self.parts, self.tick, self.over = list(numbers), 0, False
        own = [parts[k] for k in numbers]
        every, vehicles = [getattr(part, "every", 1) for part in own], [getattr(part, "vehicle", "") for part in own]
        plan = schedule([codes[k] for k in numbers], every, vehicles)
        self._plan = plan._replace(done=np.append(plan.done, 1))  # the last: whether they may end
        self._cell = Cell(self._plan)  # the same arrays; a cell is handed over faster

    def advance(self, stop: int, act: Callable[[int, int], int], failure: Callable[[int, int], Exception]) -> None:
        """Run up to before the tick `stop`, or until they are over.

        Args:
            stop: tick.
            act: what a part in Python does, by its number and the tick; gives the tick at which it has its next say.
            failure: the error of a part whose state is not sound at a tick.
        """
        k = 0
        while not self.over:
            self.tick, k, signal = run(self._cell, self.tick, k, stop)
            if signal == WAKE_PYTHON:
                self._plan.next[k] = max(act(self.parts[k], self.tick), self.tick + 1)
                k += 1
            elif signal == NON_FINITE:
                raise failure(self.parts[k], self.tick)
            else:
                self.over = signal == FINISHED
                if signal == CONTINUE:
                    return

    def follow(self, stop: int, act: Callable[[int, int], int], failure: Callable[[int, int], Exception]) -> None:
        """Run up to `stop` although they are over, because others are not; arguments as of `advance`."""
        self._plan.done[-1] = self._plan.ended[0] = 0
        self.over = False
        self.advance(stop, act, failure)
        self.over = True

    def finish(self) -> None:
        """Let the present tick be the last."""
        self._plan.ended[0] = 1

    def replace(self, part: int, code: BoundBlock) -> None:
        """Let other code step a part from now on."""
        k = self.parts.index(part)
        self._plan.function[k], self._plan.memory[k] = code.function, code.memory


def advance_all(
    turns: Sequence[ExecutionGroup], stop: int, act: Callable[[int, int], int], failure: Callable[[int, int], Exception]
) -> tuple[int, bool, LockStepError | None]:
    """Run all up to before the tick `stop`, or until the last of them is over; arguments as of
    `ExecutionGroup.advance`.

    Returns:
        The tick that all have come to, those that were over before the last one, too; whether the run is over; the
        first failure, which ends the run at its tick.
    """
    failed: LockStepError | None = None
    for turn in [turn for turn in turns if not turn.over]:
        try:
            turn.advance(stop, act, failure)
        except LockStepError as error:
            failed, stop = error, turn.tick
    if not any(turn.over for turn in turns):
        return stop, False, failed
    ended = failed is None and all(turn.over for turn in turns)
    if ended:
        stop = max(turn.tick for turn in turns)
    for turn in [turn for turn in turns if turn.over and turn.tick < stop]:
        try:
            turn.follow(stop, act, failure)
        except LockStepError as error:
            failed, stop, ended = error, turn.tick, False
    return stop, ended, failed
