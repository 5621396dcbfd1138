"""Failures of all sensors except the IMU, dispatched by reading class."""

from collections.abc import Callable
from typing import Any, NamedTuple

from numba import types

from lapwing.cosim.diagram.compiled_block import CONTINUE, InputSample
from lapwing.dynamics.noise import Key
from lapwing.kernels import always_inline
from lapwing.kernels.codegen import compile_source, dispatch, generic
from lapwing.services.autopilot.failure_injection.failure_state import Memory, is_dropped
from lapwing.services.autopilot.failure_injection.reading_failures import FAILURES
from lapwing.services.common.failure_types import DELAYED, GARBAGE, STUCK, WRONG


class SensorInjection(NamedTuple):
    """Parameters of the block."""

    faults: Any  # cell of `Faults`
    key: Key  # key of the random numbers


@generic(inline=True)
def kind_of(faults: types.Type, r: types.Type) -> Callable:
    """Return the failure type of the sensor of `r`."""
    return compile_source("kind_of(faults, r)", {}, f"return faults.{FAILURES[r.instance_class].field}")


wrong_reading = dispatch(FAILURES, 0, "wrong")
garbage_reading = dispatch(FAILURES, 0, "garbage")


@generic(inline=True)
def invalid_reading(r: types.Type) -> Callable:
    """Return the reading marked as invalid."""
    fields = ", ".join("False" if field == "valid" else f"r.{field}" for field in r.fields)
    return compile_source("invalid_reading(r)", {"Reading": r.instance_class}, f"return Reading({fields})")


@always_inline
def step(p: SensorInjection, s: Memory, tick: int, inputs: tuple[InputSample, ...]) -> tuple[Memory, tuple, int]:
    """Output the received reading; the second input is the reading `DELAY` ago."""
    r, late = inputs[0].value, inputs[1]
    kind = kind_of(p.faults.value, r)
    last = s.last if kind == STUCK else r
    x = last
    if kind == WRONG:
        x = wrong_reading(r)
    elif kind == GARBAGE:
        x = garbage_reading(r, p.key, tick)
    elif kind == DELAYED:
        x = late.value
    if is_dropped(kind, p.key, 0, s.readings) or (kind == DELAYED and not late.due):
        x = invalid_reading(r)
    return Memory(last, s.readings + 1), (x,), CONTINUE
