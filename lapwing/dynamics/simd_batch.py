"""SIMD batch of multirotors: blocks of 16 members, with a column of 16 values for each number of a member.

LLVM vectorises the loop over the members of a block, because the columns of one array are a constant distance of 16
numbers apart. Random draws and contact cannot be vectorised and run member by member. The operations on the numbers
of a member are those of `multirotor.advance` in the same order, so the results are bit-for-bit identical.
"""

# numba.core.types fills itself at import
# mypy: disable-error-code="attr-defined"

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from llvmlite import ir
from numba.core import types
from numba.core.typing.templates import signature
from numba.extending import intrinsic

from lapwing.dynamics import rate_control
from lapwing.dynamics.effects import _hooks as hooks
from lapwing.dynamics.effects._stiff_effects import have_memory_rate
from lapwing.dynamics.effects._types import AnyMassProperties, PerRotor
from lapwing.dynamics.vehicles import multirotor_stepper, step_bound
from lapwing.dynamics.vehicles.multirotor_equations import (
    MultirotorParameters,
    MultirotorState,
    StepInputs,
    motion_of,
)
from lapwing.kernels import always_inline, kernel, math, vectorise_loops
from lapwing.kernels.codegen import compile_source, generic, map_index
from lapwing.kernels.row_packing import construction, leaves, pack_row, row_width

WIDTH = 16  # number of members of a block
LINE = 8  # numbers in a cache line


class Member(NamedTuple):
    """All numbers of a member, first those that a step changes."""

    motion: Any
    memory: tuple
    body: AnyMassProperties  # mass properties in this communication step
    voltage: PerRotor  # [V]
    start: float  # [s] start of this communication step
    parameters: MultirotorParameters


def member(parameters: MultirotorParameters, state: MultirotorState) -> Member:
    """Return a member before its first step."""
    off = (0.0,) * len(parameters.layout.x_body)
    return Member(state.motion, state.memory, parameters.body, off, 0.0, parameters)


def blocks(members: int, like: Member) -> np.ndarray:
    """Return memory for a number of members, shape (blocks, columns, WIDTH)."""
    count, columns = -(-members // WIDTH), row_width(like)
    size = count * columns * WIDTH
    numbers = np.zeros(size + LINE)
    first = -numbers.ctypes.data // numbers.itemsize % LINE  # aligned: no vector is in two cache lines
    return numbers[first : first + size].reshape(count, columns, WIDTH)


def put(memory: np.ndarray, index: int, value: Member) -> None:
    """Write the numbers of a member."""
    memory[index // WIDTH, :, index % WIDTH] = pack_row(value)


@vectorise_loops
def advance(
    method, like, memory, columns, keys, ticks, commands, valid, h, n, first, last, count, rates=None, setpoints=None
):
    """Advance the members of the blocks [first, last) by `count` communication steps.

    Args:
        method: `Method()` of an integrator's module.
        like: a Member.
        memory: memory of `blocks`, flat.
        columns: number of columns of a block.
        keys: keys of the members' random numbers, shape (members, 2); members are a multiple of WIDTH.
        ticks: tick of each member, shape (members,); advanced.
        commands: voltage [V] of each motor, shape (members, rotors).
        valid: shape (members,) of bool, cleared for members that are not finite or turn too fast for a step; or None.
        h: step [s].
        n: number of steps in a communication step.
        first: first block.
        last: last block (exclusive).
        count: number of communication steps.
        rates: a RateController that overwrites the commands at each communication step, or None.
        setpoints: its thrust [N] and body rates [rad/s], shape (members, 4).
    """
    for block in range(first, last):
        base = block * columns * WIDTH
        for _ in range(count):
            for lane in range(WIDTH):
                m = np.uintp(block * WIDTH + lane)  # unsigned, so that indexing has no check for negative values
                if rates is not None:
                    rate_control.command(rates, memory, base + lane, WIDTH, setpoints, commands, m)
                _begin(like, memory, base + lane, (keys[m, 0], keys[m, 1]), ticks[m], commands, m, n * h)
                ticks[m] += 1
            split = _parts(like, memory, base, h)
            part, i = h / split, 0
            awake = 0  # number of members that cannot take step i with the others; a loop that ends early is slower
            for lane in range(WIDTH):
                alike = _is_alike(like, memory, base + lane, n * h, h, split)
                if not alike or _is_awake(like, memory, base + lane, i, part):
                    awake += 1
            while awake == 0 and i < n * split:
                for lane in range(WIDTH):
                    _airborne_step(method, like, memory, base + lane, i, part)
                    if _is_awake(like, memory, base + lane, i + 1, part):
                        awake += 1
                i += 1
            for lane in range(WIDTH if i < n * split else 0):
                split = _parts(like, memory, base + lane, h)
                _finish(method, like, memory, base + lane, n * h, h / split, i, n * split)
        if valid is not None:
            for lane in range(0 if _all_valid(like, memory, base, h) else WIDTH):
                valid[block * WIDTH + lane] &= _is_valid(like, memory, base + lane, h)


@kernel
def advance_along(method, like, memory, columns, keys, ticks, commands, motions, trace, h, n, first, last):
    """Advance the members of the blocks [first, last) under commands that change at each communication step.

    See `advance` for the other arguments.

    Args:
        commands: voltage [V] of each motor, shape (intervals, members, rotors).
        motions: first columns of each member to set before each interval, shape (intervals, members, width); shape
            (0, 0, 0) to leave them alone.
        trace: first columns of each member after each interval, shape (intervals, members, width); written.
    """
    for block in range(first, last):
        base = block * columns * WIDTH
        for k in range(len(commands)):
            if len(motions) > 0:
                for column in range(motions.shape[2]):
                    for lane in range(WIDTH):
                        memory[base + column * WIDTH + lane] = motions[k, block * WIDTH + lane, column]
            advance(method, like, memory, columns, keys, ticks, commands[k], None, h, n, block, block + 1, 1)
            for column in range(trace.shape[2]):
                for lane in range(WIDTH):
                    trace[k, block * WIDTH + lane, column] = memory[base + column * WIDTH + lane]


@always_inline
def _parts(like, memory, at, h):
    m = take(like, memory, at)
    return step_bound.parts(m.parameters, motion_of(m.parameters.layout, m.motion), m.memory, h)


@always_inline
def _is_alike(like, memory, at, interval, h, split):
    """Return True if a member has `split` substeps, no breakpoint, and a memory that lets its effects sleep.

    This is constant over a communication step as long as no effect wakes up, so it is not evaluated at each step.
    """
    m = take(like, memory, at)
    p, end = m.parameters, m.start + interval
    breaks = multirotor_stepper.next_break(p, m.memory, m.start, interval, end, h / split) < math.inf
    alike = step_bound.parts(p, motion_of(p.layout, m.motion), m.memory, h) == split and not breaks
    return alike and hooks.all_can_sleep(p.effects, m.memory)


@always_inline
def _is_valid(like, memory, at, h):
    return step_bound.is_valid(take(like, memory, at).motion, h)


@always_inline
def _all_valid(like, memory, base, h):
    invalid = 0
    for lane in range(WIDTH):
        if not _is_valid(like, memory, base + lane, h):
            invalid += 1
    return invalid == 0


@always_inline
def _command(commands, member, i):
    return commands[member, i]


@always_inline
def _begin(like, memory, at, key, tick, commands, member, interval):
    m = take(like, memory, at)
    voltages = map_index(_command, m.voltage, commands, member)
    u = multirotor_stepper.begin(m.parameters, key, tick, MultirotorState(m.motion, m.memory), voltages, interval)
    give((m.motion, u.memory, u.body, u.voltage, tick * interval), memory, at)


@always_inline
def _is_awake(like, memory, at, i, h):
    """Return True if a sleeping effect can reach a member in step i, or the member needs error control."""
    m = take(like, memory, at)
    u = StepInputs(m.parameters, m.body, m.memory, m.voltage)
    asleep = hooks.all_sleeping(m.parameters.effects, m.memory, motion_of(m.parameters.layout, m.motion), h)
    return multirotor_stepper.switches(u, m.start + i * h, m.motion, h) or not asleep


@generic(inline=True)
def _integrated(effects: types.Type, changed: types.Type) -> Callable:
    """Return the motion, and the memory if a step changes it."""
    return (lambda effects, changed: changed) if have_memory_rate(effects) else (lambda effects, changed: (changed[0],))


@always_inline
def _airborne_step(method, like, memory, at, i, h):
    m = take(like, memory, at)
    u = StepInputs(m.parameters, m.body, m.memory, m.voltage)
    changed = multirotor_stepper.airborne_step(method, u, m.start + i * h, m.motion, h)
    give(_integrated(m.parameters.effects, changed), memory, at)


@kernel
def _finish(method, like, memory, at, interval, h, first, n):
    """Integrate the rest of a communication step of one member alone."""
    m = take(like, memory, at)
    u = StepInputs(m.parameters, m.body, m.memory, m.voltage)
    give(multirotor_stepper.steps(method, u, m.motion, m.start, m.start + interval, h, first, n), memory, at)


@intrinsic
def _peek(context, array, index):
    """Return array[index] without a check for a negative index."""

    def lower_load(context, builder, sig, args):
        data = context.make_array(sig.args[0])(context, builder, args[0]).data
        return builder.load(builder.gep(data, [args[1]]))

    return signature(types.float64, array, types.intp), lower_load


@intrinsic
def _poke(context, array, index, value):
    def lower_store(context, builder, sig, args):
        data = context.make_array(sig.args[0])(context, builder, args[0]).data
        number = args[2] if args[2].type == ir.DoubleType() else builder.sitofp(args[2], ir.DoubleType())
        builder.store(number, builder.gep(data, [args[1]]))
        return context.get_dummy_value()

    return signature(types.none, array, types.intp, value), lower_store


@generic(inline=True)
def take(like: types.Type, memory: types.Type, at: types.Type) -> Callable:
    """Return a tree with the type and the arrays of `like` from numbers `WIDTH` apart, starting at `at`."""
    result, names = construction(like, lambda column: f"peek(memory, at + {column * WIDTH})", "like")
    return compile_source("take(like, memory, at)", {"peek": _peek, **names}, f"return {result}")


@generic(inline=True)
def give(tree: types.Type, memory: types.Type, at: types.Type) -> Callable:
    """Write a tree to the position that `take` reads."""
    lines = [f"poke(memory, at + {k * WIDTH}, {path})" for k, path in enumerate(leaves(tree, "tree"))]
    return compile_source("give(tree, memory, at)", {"poke": _poke}, *lines, "return None")
