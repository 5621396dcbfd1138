"""Effects that are left out of a step or integrated with the motion, by their hooks (`_hooks`)."""

from collections.abc import Callable
from typing import Any, NamedTuple

from lapwing.dynamics.effects._hooks import HOOKS, wrench
from lapwing.dynamics.vector import Vec3
from lapwing.kernels.codegen import compile_source, generic


@generic(inline=True)
def all_stiff_sleeping(effects: Any, memory: Any, motion: Any, h: Any) -> Callable:
    """Return True if every stiff effect is sleeping, and can."""
    both = HOOKS["substeps"], HOOKS["is_sleeping"]
    stiff = [
        (i, e.instance_class) for i, e in enumerate(effects.types) if all(e.instance_class in hook for hook in both)
    ]
    names: dict[str, Any] = {}
    calls = []
    for hook, arguments in (("is_sleeping", "motion, h"), ("can_sleep", "memory[{i}]")):
        for i, parameters in stiff:
            if parameters in HOOKS[hook]:
                names[f"{hook}{i}"] = HOOKS[hook][parameters]
                calls.append(f"{hook}{i}(effects[{i}], {arguments.format(i=i)})")
    return compile_source(
        "all_stiff_sleeping(effects, memory, motion, h)", names, f"return {' and '.join(calls) or 'True'}"
    )


@generic(inline=True)
def without_sleepers(effects: Any, values: Any) -> Callable:
    """Return the members of `values`, one for each effect, that belong to effects that never sleep."""
    items = "".join(
        f"values[{i}], " for i, e in enumerate(effects.types) if e.instance_class not in HOOKS["is_sleeping"]
    )
    return compile_source("without_sleepers(effects, values)", {}, f"return ({items})")


class KnownWrench(NamedTuple):
    """Placeholder of an effect whose wrench has been evaluated together with the rate of its memory."""

    force_world: Vec3  # [N]
    torque_body: Vec3  # [N m]


@wrench(KnownWrench)
def known_wrench(e, memory, s, rotors):
    """Return the wrench."""
    return e.force_world, e.torque_body


def _hooks_with_rate(effects: Any) -> list[tuple[int, Callable]]:
    """Return (number, hook) of each effect whose memory has a rate."""
    rates = HOOKS["wrench_and_rate"]
    return [(i, rates[e.instance_class]) for i, e in enumerate(effects.types) if e.instance_class in rates]


@generic(inline=True)
def with_rates(effects: Any, memory: Any, motion: Any) -> Callable:
    """Return (effects, with the wrenches of those that have one in their place; rates of their memories)."""
    active = dict(_hooks_with_rate(effects))
    names = {"known": KnownWrench, **{f"f{i}": hook for i, hook in active.items()}}
    lines = [f"force{i}, torque{i}, rate{i} = f{i}(effects[{i}], memory[{i}], motion)" for i in active]
    count = len(effects.types)
    items = "".join(f"known(force{i}, torque{i}), " if i in active else f"effects[{i}], " for i in range(count))
    rates = "".join(f"rate{i}, " for i in active)
    return compile_source("with_rates(effects, memory, motion)", names, *lines, f"return ({items}), ({rates})")


@generic(inline=True)
def all_integrated(effects: Any, memory: Any) -> Callable:
    """Return the memories that have a rate."""
    members = "".join(f"memory[{i}], " for i, _ in _hooks_with_rate(effects))
    return compile_source("all_integrated(effects, memory)", {}, f"return ({members})")


@generic(inline=True)
def with_integrated(effects: Any, memory: Any, integrated: Any) -> Callable:
    """Return the memories of all effects, with those that have a rate from `integrated`."""
    integrated = [i for i, _ in _hooks_with_rate(effects)]
    members = [
        f"integrated[{integrated.index(i)}]" if i in integrated else f"memory[{i}]" for i in range(len(effects.types))
    ]
    result = "".join(f"{member}, " for member in members)
    return compile_source("with_integrated(effects, memory, integrated)", {}, f"return ({result})")
