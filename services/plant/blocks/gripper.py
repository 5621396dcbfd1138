"""Gripper that releases the payload on command of the autopilot."""

from collections.abc import Callable

from numba import types

from lapwing.dynamics.effects.payload_release import RELEASED, PayloadRelease
from lapwing.kernels.codegen import compile_source, overload_for


def release_payload(effects: tuple, memory: tuple) -> tuple:
    """Return the effects' discrete state after the release of the payload; unchanged without a payload."""
    raise NotImplementedError("compiled code only")


@overload_for(release_payload, inline=True)
def _let_go(effects: types.BaseTuple, memory: types.BaseTuple) -> Callable:
    carried = [getattr(kind, "instance_class", None) is PayloadRelease for kind in effects]
    parts = "".join("gone, " if payload else f"memory[{k}], " for k, payload in enumerate(carried))
    body = f"return ({parts})" if any(carried) else "return memory"
    return compile_source("release_payload(effects, memory)", {"gone": RELEASED}, body)
