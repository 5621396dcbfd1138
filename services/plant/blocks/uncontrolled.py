"""Plant without inputs: a system of lapwing/dynamics/vehicles, advanced by any integrator."""

from collections.abc import Callable
from typing import Any, NamedTuple

from numba import types

from lapwing.cosim.diagram.compiled_block import InputSample
from lapwing.dynamics.integrators import StepDoubling, integrate_fixed, integrate_step_doubling
from lapwing.kernels import DispatchTable, always_inline
from lapwing.kernels.codegen import generic
from lapwing.kernels.state_tree import finite
from lapwing.services.plant.blocks.termination import termination_status


class AutonomousPlant(NamedTuple):
    """Parameters of the block: the system and its integration."""

    system: Any  # parameters, a class of lapwing.dynamics.integrators.RATES
    method: Any  # `Method()` of an integrator, or `StepDoubling` with error control
    steps: int  # per tick
    step: float  # [s]
    interval: float  # [s] length of a tick
    last: int  # last tick of the run


OUTPUT_FUNCTIONS = DispatchTable()
"""Function of `outputs_of` by class of a system's parameters."""


@generic(inline=True)
def outputs_of(p: types.Type, t: types.Type, x: types.Type) -> Any:
    """Return the port values of state x at time t [s], by the class of the parameters p."""
    return OUTPUT_FUNCTIONS[p.instance_class]


@generic(inline=True)
def _advance(method: types.Type, p: types.Type, t: types.Type, x: types.Type) -> Callable:
    if getattr(method, "instance_class", None) is StepDoubling:
        return lambda method, p, t, x: integrate_step_doubling(method, p.system, t, x, p.step, t + p.interval)
    return lambda method, p, t, x: integrate_fixed(method, p.system, t, x, p.step, p.steps)


@always_inline
def step(p: AutonomousPlant, s: Any, tick: int, inputs: tuple[InputSample, ...]) -> tuple[Any, tuple, int]:
    """Integrate to `tick`; tick 0 is the initial state."""
    x = s
    if tick > 0:
        x = _advance(p.method, p, (tick - 1) * p.interval, x)
    return x, outputs_of(p.system, tick * p.interval, x), termination_status(tick, p.last, finite(x))
