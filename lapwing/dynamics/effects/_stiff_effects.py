"""Effects that are left out of a step or integrated with the motion, by their hooks (`_hooks`)."""

import itertools
from collections.abc import Callable
from typing import Any, NamedTuple

from lapwing.dynamics.effects._external_inputs import has_inputs
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


def only_stiff_sleep(effects: Any) -> bool:
    """Return True if every effect that can sleep is stiff, by the type of the tuple of effects."""
    sleeps, stiff = (HOOKS["is_sleeping"], HOOKS["can_sleep"]), (HOOKS["is_sleeping"], HOOKS["substeps"])
    classes = [e.instance_class for e in effects.types if any(e.instance_class in hook for hook in sleeps)]
    return all(each in hook for each in classes for hook in stiff)


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


def _own_memories(effects: Any) -> dict[int, str]:
    """Return the number of each effect whose memory has a rate, and the place of that memory."""
    both = HOOKS["wrench_and_rate"], HOOKS["memory_rate"]
    return {
        i: f"memory[{i}][0]" if has_inputs(e.instance_class) else f"memory[{i}]"
        for i, e in enumerate(effects.types)
        if any(e.instance_class in hook for hook in both)
    }


def have_memory_rate(effects: Any) -> bool:
    """Return True if the memory of any effect is integrated in every step, by the type of the tuple of effects."""
    return any(e.instance_class in HOOKS["memory_rate"] for e in effects.types)


@generic(inline=True)
def with_wrenches(effects: Any, memory: Any, motion: Any) -> Callable:
    """Return (effects, with the wrenches of stiff ones in their place; the rate of each one's memory, or ())."""
    rates = HOOKS["wrench_and_rate"]
    active = {i: rates[e.instance_class] for i, e in enumerate(effects.types) if e.instance_class in rates}
    names = {"known": KnownWrench, **{f"f{i}": hook for i, hook in active.items()}}
    lines = [f"force{i}, torque{i}, rate{i} = f{i}(effects[{i}], memory[{i}], motion)" for i in active]
    count = len(effects.types)
    items = "".join(f"known(force{i}, torque{i}), " if i in active else f"effects[{i}], " for i in range(count))
    result = "".join(f"rate{i}, " if i in active else "(), " for i in range(count))
    return compile_source("with_wrenches(effects, memory, motion)", names, *lines, f"return ({items}), ({result})")


@generic(inline=True)
def all_rates(effects: Any, memory: Any, stiff: Any, s: Any, rotors: Any) -> Callable:
    """Return the rates of the memories of `all_integrated`; `stiff` are those of `with_wrenches`."""
    names, members = {}, []
    for i in _own_memories(effects):
        parameters = effects.types[i].instance_class
        if parameters in HOOKS["memory_rate"]:
            names[f"f{i}"] = HOOKS["memory_rate"][parameters]
            members.append(f"f{i}(effects[{i}], memory[{i}], s, rotors), ")
        else:
            members.append(f"stiff[{i}], ")
    return compile_source("all_rates(effects, memory, stiff, s, rotors)", names, f"return ({''.join(members)})")


@generic(inline=True)
def all_integrated(effects: Any, memory: Any) -> Callable:
    """Return the memories that have a rate."""
    members = "".join(f"{place}, " for place in _own_memories(effects).values())
    return compile_source("all_integrated(effects, memory)", {}, f"return ({members})")


@generic(inline=True)
def with_integrated(effects: Any, memory: Any, integrated: Any) -> Callable:
    """Return the memories of all effects, with those that have a rate from `integrated`."""
    members = [f"memory[{i}]" for i in range(len(effects.types))]
    for k, (i, place) in enumerate(_own_memories(effects).items()):
        members[i] = f"integrated[{k}]" if place == members[i] else f"(integrated[{k}], memory[{i}][1])"
    result = "".join(f"{member}, " for member in members)
    return compile_source("with_integrated(effects, memory, integrated)", {}, f"return ({result})")


@generic(inline=True)
def with_awake(effects: Any, memory: Any, awake: Any) -> Callable:
    """Return the memories of all effects, with those of `without_sleepers` from `awake`."""
    if not have_memory_rate(effects):
        return lambda effects, memory, awake: memory
    number = itertools.count()
    result = "".join(
        f"memory[{i}], " if e.instance_class in HOOKS["is_sleeping"] else f"awake[{next(number)}], "
        for i, e in enumerate(effects.types)
    )
    return compile_source("with_awake(effects, memory, awake)", {}, f"return ({result})")
