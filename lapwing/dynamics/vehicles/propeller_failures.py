"""A communication step in which propellers fail: it is split at the times of the failures (theory, section 6.8)."""

import math
from typing import Any, NamedTuple

from numba import types

from lapwing.dynamics.effects import _hooks as hooks
from lapwing.dynamics.multibody.five_bodies import FiveBodies
from lapwing.dynamics.vehicles import multirotor_euler
from lapwing.dynamics.vehicles.multirotor_equations import (
    MultirotorParameters,
    MultirotorState,
    StepInputs,
    motion_of,
)
from lapwing.dynamics.vehicles.multirotor_multibody_equations import apply_constraint_impulse
from lapwing.dynamics.vehicles.multirotor_stepper import BREAK_ROUNDING, begin, steps
from lapwing.dynamics.vehicles.step_bound import parts
from lapwing.kernels import kernel
from lapwing.kernels.codegen import generic


class Failure(NamedTuple):
    """Failure of a propeller: its time, and the vehicle after it."""

    time: float  # [s]; a time before the communication step is its start
    vehicle: MultirotorParameters  # parameters after the failure
    impulse: bool  # True if the new constraints are violated at that time: hinge impulses satisfy them


@generic()
def _after_impulses(u: types.Type, x: types.Type) -> Any:
    """Return the bodies after impulses in their hinges, in any coordinates."""
    return apply_constraint_impulse if x.instance_class is FiveBodies else multirotor_euler.apply_constraint_impulse


@kernel
def _after_failure(failure, memory, voltage, x):
    """Return (step inputs, motion) after a failure."""
    p = failure.vehicle
    u = StepInputs(p, hooks.all_mass_properties(p.effects, memory, p.body), memory, voltage)
    return u, _after_impulses(u, x) if failure.impulse else x


@kernel
def advance_through(method, p, failures, key, tick, state, command, h, n):
    """Return the state a communication step later, in which `failures` occur. See `multirotor.advance` for arguments.

    Args:
        failures: of type `Failure`, ascending in time; at least one.
    """
    interval = n * h
    start, end = tick * interval, tick * interval + interval
    count, rounding = len(failures), BREAK_ROUNDING * interval
    k = 0
    while k < count and failures[k].time <= start + rounding:
        u, x = _after_failure(failures[k], state.memory, command, state.motion)
        p, state = failures[k].vehicle, MultirotorState(x, state.memory)
        k += 1
    u, x = begin(p, key, tick, state, command, interval), state.motion
    split, whole = parts(p, motion_of(p.layout, x), u.memory, h), k == count
    size, number, longest = h / split, n * split, h / split
    while True:
        until = failures[k].time if k < count else end
        if not whole:
            number = max(1, math.ceil((until - start) / longest - BREAK_ROUNDING))
            size = (until - start) / number
        x, memory = steps(method, u, x, start, until, size, 0, number)
        if k == count:
            return MultirotorState(x, memory)
        u, x = _after_failure(failures[k], memory, u.voltage, x)
        start = until
        k += 1
