"""Compiled loop over the blocks of a diagram, and the block that runs now, for the watchdog.

`RUNNING` belongs to the process: a watchdog in another thread reads it while compiled code or a Python block hangs.
"""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from lapwing.cosim.diagram.compiled_block import CONTINUE, FINISHED, NON_FINITE, WAKE_PYTHON, BoundBlock
from lapwing.kernels import kernel

IDLE, COMPILING = 0, 1  # labels while no block runs, and while kernels compile before the first tick
RUNNING = np.zeros(2, np.int64)
"""Label of the block that runs, and the number of ticks that this process has run so far."""
NAMES = np.zeros((1 << 14, 64), np.uint8)
"""Names of the blocks of this process by label, UTF-8, padded with zeros; the last is that of all further blocks.
That of `COMPILING` has the services whose kernels compile."""
NAMES[-1, :5] = list(b"other")
_labels = {"": IDLE, "\0": COMPILING}


def label(name: str) -> int:
    """Return the label of a block in this process."""
    number = _labels.setdefault(name, min(len(_labels), len(NAMES) - 1))
    if number < len(NAMES) - 1:
        _set_name(number, name)
    return number


def _set_name(number: int, name: str) -> None:
    text = name.encode(errors="replace")[: NAMES.shape[1] - 1]
    NAMES[number] = list(text.ljust(NAMES.shape[1], b"\0"))


def set_compiling(services: str) -> None:
    """Set the services whose kernels compile in this process, "" after the compilation; no effect within a block."""
    if RUNNING[0] in (IDLE, COMPILING):
        _set_name(COMPILING, services)
        RUNNING[0] = COMPILING if services else IDLE


def running_block() -> str:
    """Return the name of the block that runs, "" if none does."""
    return NAMES[RUNNING[0]].tobytes().rstrip(b"\0").decode(errors="replace")


@intrinsic
def _invoke(typing_context: Any, function: types.Type, memory: types.Type, tick: types.Type) -> tuple[Any, Callable]:
    def generate(context: Any, builder: ir.IRBuilder, signature: Any, arguments: Sequence[ir.Value]) -> ir.Value:
        pointer = ir.IntType(8).as_pointer()
        structure = ir.LiteralStructType([pointer])
        kind = ir.FunctionType(ir.IntType(64), [structure, ir.IntType(64)])
        cell = builder.insert_value(ir.Constant(structure, ir.Undefined), builder.inttoptr(arguments[1], pointer), 0)
        return builder.call(builder.inttoptr(arguments[0], kind.as_pointer()), [cell, arguments[2]])

    return types.int64(types.int64, types.int64, types.int64), generate


class Schedule(NamedTuple):
    """Blocks of a diagram in their order of execution, for the compiled loop."""

    function: np.ndarray  # (n,) int64 address; 0: a Python block
    memory: np.ndarray  # (n,) int64 address
    every: np.ndarray  # (n,) int64 [ticks] between two steps of a compiled block
    next: np.ndarray  # (n,) int64 tick of the next step
    vehicle: np.ndarray  # (n,) int64 number of the block's vehicle
    done: np.ndarray  # (vehicles,) int64: 1 after a block of the vehicle has finished
    ended: np.ndarray  # (1,) int64: 1 after all vehicles have finished
    label: np.ndarray  # (n,) int64 labels of the blocks
    running: np.ndarray  # RUNNING of this process


def schedule(
    codes: Sequence[BoundBlock | None], every: Sequence[int], vehicles: Sequence[str], names: Sequence[str]
) -> Schedule:
    """Return the schedule of blocks with vehicle and name of each. None is a Python block, first run at tick 0."""
    distinct = list(dict.fromkeys(vehicles)) or [""]
    return Schedule(
        np.array([code.function if code else 0 for code in codes], np.int64),
        np.array([code.memory if code else 0 for code in codes], np.int64),
        np.array(every, np.int64),
        np.zeros(len(codes), np.int64),
        np.array([distinct.index(name) for name in vehicles], np.int64),
        np.zeros(len(distinct), np.int64),
        np.zeros(1, np.int64),
        np.array([label(name) for name in names], np.int64),
        RUNNING,
    )


@kernel
def run(schedule: Any, tick: int, first: int, stop: int) -> tuple[int, int, int]:
    """Run the schedule in a cell from block `first` of `tick` to the tick `stop` (exclusive), or to a Python block.

    Returns:
        (tick, block, status). WAKE_PYTHON: run the Python block at the tick, then continue with the next block.
        NON_FINITE: the state of the block is non-finite. FINISHED: the previous tick was the last. CONTINUE: the tick
        is `stop`.
    """
    plan = schedule.value
    while tick < stop:
        for k in range(first, len(plan.function)):
            if plan.next[k] > tick:
                continue
            plan.running[0] = plan.label[k]
            if plan.function[k] == 0:
                return tick, k, WAKE_PYTHON
            plan.next[k] = tick + plan.every[k]
            status = _invoke(plan.function[k], plan.memory[k], tick)
            if status != CONTINUE:
                if status == NON_FINITE:
                    return tick, k, NON_FINITE
                if status == FINISHED:
                    plan.done[plan.vehicle[k]] = 1
                    plan.ended[0] = plan.done.min()
                elif status == WAKE_PYTHON:
                    for j in range(k + 1, len(plan.function)):
                        if plan.function[j] == 0 and plan.vehicle[j] == plan.vehicle[k]:
                            plan.next[j] = tick
        first = 0
        tick += 1
        plan.running[1] += 1
        if plan.ended[0] == 1:
            return tick, 0, FINISHED
    return tick, 0, CONTINUE
