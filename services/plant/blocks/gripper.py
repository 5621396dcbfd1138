"""A gripper that lets the payload go when the autopilot says so."""

from collections.abc import Callable

from numba import types

from lapwing.dynamics.effects.payload_release import RELEASED, PayloadRelease
from lapwing.kernels.codegen import compile_source, overload_for


def let_go(effects: tuple, memory: tuple) -> tuple:
    """The effects' memory after the payload was let go; the same where no effect is a payload."""
    raise NotImplementedError("compiled code only")


@overload_for(let_go, inline=True)
def _let_go(effects: types.BaseTuple, memory: types.BaseTuple) -> Callable:
    carried = [getattr(kind, "instance_class", None) is PayloadRelease for kind in effects]
    parts = "".join("gone, " if payload else f"memory[{k}], " for k, payload in enumerate(carried))
    body = f"return ({parts})" if any(carried) else "return memory"
    return compile_source("let_go(effects, memory)", {"gone": RELEASED}, body)
