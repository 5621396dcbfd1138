"""Bound of an integrator step by the rotation in it and by the fastest damping: motors, memories and drag.

Steps beyond the bound are split, in every mode of a run; `causes` names what splits them.
"""

from typing import Any, NamedTuple

from lapwing.dynamics.effects import _hooks as hooks
from lapwing.dynamics.vector import ZERO, norm
from lapwing.kernels import always_inline, math, python_function
from lapwing.kernels.state_tree import finite

FASTEST_RATE = 1.0  # largest product of damping rate and step: every explicit method is stable up to 2
LARGEST_TURN = 0.25  # [rad] rotation in a step beyond which no method is accurate
MOST_PARTS = 10_000  # of a step


class Cause(NamedTuple):
    """Part of the plant that decays within less than a step."""

    name: str
    rate: float  # [1/s]


@always_inline
def is_valid(motion, h):
    """Return True if a motion is finite and its rotation in a step of h [s] needs no more than `MOST_PARTS`."""
    return finite(motion) & (norm(motion.omega_body) * h <= LARGEST_TURN * MOST_PARTS)


@always_inline
def parts(p, motion, memory, h):
    """Return the number of parts of a step of h [s], at most `MOST_PARTS`; 1 for a motion that is not valid.

    Args:
        p: MultirotorParameters.
        motion: Motion at the start of the step.
        memory: discrete state of the effects.
        h: step [s].
    """
    if not is_valid(motion, h):
        return 1  # lost; parts would only cost time
    rate = max(p.layout.lag_rate, hooks.all_decay_rates(p.effects, memory, motion, p.body, p.layout))
    number = max(h * rate / FASTEST_RATE, h * norm(motion.omega_body) / LARGEST_TURN)
    return max(1, math.ceil(number)) if number < MOST_PARTS else MOST_PARTS


def causes(p: Any, memory: tuple) -> list[Cause]:
    """Return the rates of a vehicle at rest, the fastest first: the motors' lag, and effects by name."""
    result = [Cause("motors", p.layout.lag_rate)]
    for e, own in zip(p.effects, memory, strict=True):
        if type(e) in hooks.HOOKS["decay_rate"]:
            rate = python_function(hooks.HOOKS["decay_rate"][type(e)])(e, own, _AT_REST, p.body, p.layout)
            result.append(Cause(type(e).__module__.rsplit(".", 1)[-1], rate))
    return sorted(result, key=lambda cause: -cause.rate)


class _Rest(NamedTuple):
    velocity_world: tuple[float, float, float] = ZERO
    omega_body: tuple[float, float, float] = ZERO


_AT_REST = _Rest()
