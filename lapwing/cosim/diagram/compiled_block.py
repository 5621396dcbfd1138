"""Compiled block of a service: reads the samples that are due, steps, and writes its outputs.

A block is described by its parameters, a NamedTuple. The module of their class has the pure function

    step(parameters, state, tick, inputs) -> (state, outputs, status)

`inputs` is a tuple of `InputSample`, `outputs` a tuple of trees, one for each port. The state is in a cell, which
blocks of one service may share. Every block is compiled once, to a function of (its memory, tick). Every executor calls
the same machine code by its address, so the results of all executors are bit-for-bit identical.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any, NamedTuple

import numba
import numpy as np
from numba import types

from lapwing.cosim.diagram.tick_schedule import LATCHED, InputPort, Port, due
from lapwing.kernels import DispatchTable, always_inline, kernel, no_refcount
from lapwing.kernels.cell import Cell
from lapwing.kernels.codegen import compile_source, dispatch, generic
from lapwing.kernels.row_packing import load, store

CONTINUE, WAKE_PYTHON, FINISHED, NON_FINITE = range(4)
"""Step status: continue; wake Python blocks at this tick; this tick is the last; the state is non-finite."""


class InputSample(NamedTuple):
    """Sample of an input at a tick; the value is undefined unless a sample is due."""

    due: bool
    value: Any


class InputRing(NamedTuple):
    """Ring buffer of rows that an input reads."""

    example: Any
    rows: np.ndarray  # (depth, width), the depth a power of two
    period: int
    delay: int


class OutputRing(NamedTuple):
    """Ring buffer of rows that an output writes."""

    rows: np.ndarray  # (depth, width)
    period: int


class BlockData(NamedTuple):
    """Data of a compiled block."""

    parameters: Any
    state: Any  # cell
    inputs: tuple
    outputs: tuple


@dataclass
class Block:
    """Compiled block as its service declares it.

    Attributes:
        name: "plant", "sensors.imu".
        parameters: a NamedTuple whose module has `step`.
        state: the cell that holds its state.
        inputs: its input ports, in the order of the argument `inputs`.
        outputs: its output ports, in the order of its outputs.
        every: ticks between two steps.
        failure: returns the error of a tick at which the state is non-finite.
        vehicle: vehicle of a fleet that it belongs to.
        trusted: True if its step never replaces an array, so that references need not be counted.
    """

    name: str
    parameters: Any
    state: Any
    inputs: tuple[InputPort, ...] = ()
    outputs: tuple[Port, ...] = ()
    every: int = 1
    failure: Callable[[int], Exception] | None = None
    vehicle: str = ""
    trusted: bool = True


class BoundBlock(NamedTuple):
    """Machine code of a bound block."""

    function: int  # address
    memory: int  # address
    cell: Any  # owner of the memory; it must live as long as the code is called


def bind(block: Block, ports: dict[str, Port], rows: dict[str, np.ndarray]) -> BoundBlock:
    """Compile or load a block, and bind it to the rows of its ports.

    Args:
        block: block to run.
        ports: ports by name.
        rows: ring buffer of each port by name, shape (2^k, width).
    """
    inputs = tuple(InputRing(ports[i.port].example, rows[i.port], ports[i.port].period, i.delay) for i in block.inputs)
    outputs = tuple(OutputRing(rows[port.name], port.period) for port in block.outputs)
    cell = Cell(BlockData(block.parameters, block.state, inputs, outputs))
    return BoundBlock(_address(numba.typeof(cell), block.trusted), cell.memory.pointer, cell)


@cache
def _address(cell: types.Type, trusted: bool) -> int:
    """Return the address of the machine code that advances a block with a cell of this type."""
    signature, function = (cell, types.int64), advance if trusted else advance_counted
    function.compile(signature)  # type: ignore[attr-defined]
    compiled: Any = function.overloads[signature]  # type: ignore[attr-defined]
    return compiled.library.get_pointer_to_function(compiled.fndesc.llvm_cfunc_wrapper_name)


step = dispatch(DispatchTable("step"))


@always_inline
def ring_index(stamp: int, period: int, rows: np.ndarray) -> int:
    """Return the index of the sample with the tick `stamp` in the ring buffer `rows`, shape (2^k, width)."""
    if period == 1:
        return stamp & (rows.shape[0] - 1)
    return 0 if period == LATCHED else (stamp // period) & (rows.shape[0] - 1)


@always_inline
def _take(ring: InputRing, tick: int) -> InputSample:
    stamp = due(tick, ring.period, ring.delay)
    return InputSample(stamp >= 0, load(ring.example, ring.rows, ring_index(stamp, ring.period, ring.rows)))


@always_inline
def _put(value: Any, ring: OutputRing, tick: int) -> None:
    if due(tick, ring.period, 0) >= 0:
        store(value, ring.rows, ring_index(tick, ring.period, ring.rows))


@generic(inline=True)
def _take_all(inputs: types.Type, tick: types.Type) -> Callable:
    calls = "".join(f"take(inputs[{i}], tick), " for i in range(len(inputs)))
    return compile_source("take_all(inputs, tick)", {"take": _take}, f"return ({calls})")


@generic(inline=True)
def _put_all(values: types.Type, outputs: types.Type, tick: types.Type) -> Callable:
    calls = [f"put(values[{i}], outputs[{i}], tick)" for i in range(len(outputs))]
    return compile_source("put_all(values, outputs, tick)", {"put": _put}, *calls, "return None")


@no_refcount
def advance(memory: Any, tick: int) -> int:
    """Step the block whose `BlockData` is in the cell `memory`. Return the step status."""
    core = memory.value
    s, outputs, status = step(core.parameters, core.state.value, tick, _take_all(core.inputs, tick))
    core.state.value = s
    _put_all(outputs, core.outputs, tick)
    return status


@kernel
def advance_counted(memory: Any, tick: int) -> int:
    """Advance a block whose step may replace an array (docs/explanation/decisions/0017): references are counted."""
    return advance(memory, tick)
