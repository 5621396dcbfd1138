"""Execution groups: sets of blocks that are stepped tick by tick, independently of the other sets.

A vehicle that steps through a block of ticks alone stays in the processor's cache. If 32 vehicles alternate at every
tick, each step costs 10 % more (docs/reference/benchmarks.md). The results are bit-for-bit identical.
"""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from lapwing.cosim.diagram.compiled_block import CONTINUE, FINISHED, NON_FINITE, WAKE_PYTHON, BoundBlock
from lapwing.cosim.diagram.compiled_loop import IDLE, RUNNING, run, schedule
from lapwing.cosim.run_errors import LockStepError
from lapwing.kernels.cell import Cell


def independent_groups(blocks: Sequence[Any]) -> list[list[int]]:
    """Return the numbers of the blocks of each group.

    A vehicle is a group, unless a block reads a port of another vehicle or an external port: then all form one group.
    """
    vehicles = [getattr(block, "vehicle", "") for block in blocks]
    producer = {port.name: vehicle for block, vehicle in zip(blocks, vehicles, strict=True) for port in block.outputs}
    for block, vehicle in zip(blocks, vehicles, strict=True):
        if any(producer.get(i.port) != vehicle for i in getattr(block, "inputs", ())):
            return [list(range(len(blocks)))]
    return [[k for k, other in enumerate(vehicles) if other == vehicle] for vehicle in dict.fromkeys(vehicles)]


class ExecutionGroup:
    """Blocks that step together.

    Attributes:
        blocks: numbers of the blocks in the diagram, in order.
        tick: next tick.
        finished: True if the previous tick was their last.
    """

    def __init__(self, numbers: Sequence[int], blocks: Sequence[Any], codes: Sequence[BoundBlock | None]):
        """Select the blocks `numbers` of a diagram, with their compiled code (None for Python blocks)."""
        self.blocks, self.tick, self.finished = list(numbers), 0, False
        own = [blocks[k] for k in numbers]
        every, vehicles = (
            [getattr(block, "every", 1) for block in own],
            [getattr(block, "vehicle", "") for block in own],
        )
        plan = schedule([codes[k] for k in numbers], every, vehicles, [block.name for block in own])
        self._plan = plan._replace(done=np.append(plan.done, 1))  # the last entry: 1 if the group may end
        self._cell = Cell(self._plan)  # shares the arrays; a cell is a faster argument

    def advance(self, stop: int, on_tick: Callable[[int, int], int], failure: Callable[[int, int], Exception]) -> None:
        """Run to the tick `stop` (exclusive), or until the blocks have finished.

        Args:
            stop: last tick (exclusive).
            on_tick: runs the Python block of a number at a tick; returns the tick of its next wake-up.
            failure: returns the error of a block whose state is invalid at a tick.

        Raises:
            LockStepError: the error of `failure`, or one that a Python block raises.
        """
        k = 0
        try:
            while not self.finished:
                self.tick, k, status = run(self._cell, self.tick, k, stop)
                if status == WAKE_PYTHON:
                    self._plan.next[k] = max(on_tick(self.blocks[k], self.tick), self.tick + 1)
                    k += 1
                elif status == NON_FINITE:
                    raise failure(self.blocks[k], self.tick)
                else:
                    self.finished = status == FINISHED
                    if status == CONTINUE:
                        return
        finally:
            RUNNING[0] = IDLE

    def run_past_end(
        self, stop: int, on_tick: Callable[[int, int], int], failure: Callable[[int, int], Exception]
    ) -> None:
        """Run to `stop` after the end, because other groups have not ended. See `advance` for arguments."""
        self._plan.done[-1] = self._plan.ended[0] = 0
        self.finished = False
        self.advance(stop, on_tick, failure)
        self.finished = True

    def replace(self, number: int, code: BoundBlock) -> None:
        """Replace the machine code of a block of the diagram."""
        k = self.blocks.index(number)
        self._plan.function[k], self._plan.memory[k] = code.function, code.memory


def advance_groups(
    groups: Sequence[ExecutionGroup],
    stop: int,
    on_tick: Callable[[int, int], int],
    failure: Callable[[int, int], Exception],
) -> tuple[int, bool, LockStepError | None]:
    """Run all groups to the tick `stop` (exclusive), or until the last one has finished.

    See `ExecutionGroup.advance` for arguments.

    Returns:
        The tick that all groups have reached, True if the run has ended, and the first failure, which ends the run.
    """
    failed: LockStepError | None = None
    for group in [group for group in groups if not group.finished]:
        try:
            group.advance(stop, on_tick, failure)
        except LockStepError as error:
            failed, stop = error, group.tick
    if not any(group.finished for group in groups):
        return stop, False, failed
    ended = failed is None and all(group.finished for group in groups)
    if ended:
        stop = max(group.tick for group in groups)
    for group in [group for group in groups if group.finished and group.tick < stop]:
        try:
            group.run_past_end(stop, on_tick, failure)
        except LockStepError as error:
            failed, stop, ended = error, group.tick, False
    return stop, ended, failed
