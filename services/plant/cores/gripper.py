"""A gripper that lets the payload go when the autopilot says so."""

from numba.extending import overload

from dynamics.effects.payload import RELEASED, Payload


def let_go(effects, memory):
    """The effects' memory after the payload was let go; the same where no effect is a payload."""
    raise NotImplementedError("compiled code only")


@overload(let_go, jit_options={"forceinline": True})
def _let_go(effects, memory):
    held = [getattr(kind, "instance_class", None) is Payload for kind in effects]
    if not any(held):
        return lambda effects, memory: memory
    parts = "".join("gone, " if h else f"memory[{k}], " for k, h in enumerate(held))
    names = {"gone": RELEASED}
    exec(f"def released(effects, memory):\n    return ({parts})\n", names)
    return names["released"]
