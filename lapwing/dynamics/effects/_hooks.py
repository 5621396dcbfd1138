"""What an effect may do, and how a scene's effects are combined without run-time cost.

A scene's effects are a tuple of parameter NamedTuples, one per active effect, sorted by name; beside it runs a tuple of
equal length with each effect's memory. An effect registers compiled functions ("hooks") for its parameter type. From
the *types* in the tuple the calls are written out as straight-line code when the plant is compiled: an effect that is
not in the tuple leaves no trace in the machine code.

The stages of one evaluation, in order, each a hook:

    air       (e, memory, s, air) -> Air                     density and wind at the vehicle
    air_rate  (e, memory, s, rate_body) -> rate_body [rad/s] at which the air turns
    factors   (e, memory, s, factors) -> Factors             on each rotor's thrust and torque
    loads     (e, memory, s, factors, loads) -> Loads        thrust and torque of each rotor, added to those before
    supply    (e, memory, voltage) -> voltage                what the battery lets the motors have
    gauge     (e, memory) -> (charge, voltage [V], current [A], temperature [K], NaN where not modelled) of the battery
    motor     (e, memory, s, loads, voltage) -> (acceleration, current, power) of each rotor; one effect only
    wrench    (e, memory, s, rotors) -> (force_world [N], torque_body [N m]) at the centre of mass
    wrench_body  the same with the force in body coordinates
    torque    (e, memory, s, rotors) -> torque_body [N m], where there is no force
    field     (e, memory) -> acceleration of gravity, world [m/s^2]: of what wrench, for each of several bodies

and between evaluations:

    body      (e, memory, body) -> MassProperties      mass and inertia for the next exchange interval
    sample    (e, memory, s, rotors, key, tick, interval) -> memory    once an exchange interval, before its first step;
                                                       s and rotors are those without the effects that can sleep
    asleep    (e, memory, motion, h) -> bool           can the effect do nothing within the next step?
    substeps  (e, memory, motion, h) -> int            of an effect that can sleep and is stiff: how many steps to split
                                                       the next one into at least, when awake
    settle    (e, memory, motion, h) -> memory         after every step, when awake
    event     (e, before, after) -> bool               of two memories: did forces jump in the step between them?
    contact   (e, memory, s) -> bool                   does the vehicle touch the ground?
    contact_forces   (e, memory, motion) -> ((place [m], force [N]) of every point that may touch it), world
    wind      (e, memory, wind) -> wind                [m/s] world: for the log, of an effect that blows without moving
                                                       the air that others feel

While all effects that can sleep are asleep, steps are taken without them, at no cost but the question. While one that
is stiff is awake, steps are taken under error control, their memory included
(`lapwing.dynamics.vehicles.multirotor_stepper`).

The memory of an effect is a tuple of floats that its parameter class gives with `initial_memory()`; () without it.
"""

from collections.abc import Callable
from typing import Any

from numba.core.errors import TypingError

from lapwing.dynamics.effects._axes import beside, in_world
from lapwing.dynamics.vector import add, apply
from lapwing.kernels import DispatchTable, always_inline
from lapwing.kernels.codegen import compile_source, generated_overload

HOOKS: dict[str, DispatchTable] = {}


def _hook(name: str) -> Callable:
    registered = HOOKS.setdefault(name, DispatchTable())

    def for_type(parameters: type) -> Callable:
        def register(function: Callable) -> Callable:
            registered[parameters] = always_inline(function)
            return registered[parameters]

        return register

    return for_type


body = _hook("body")
air = _hook("air")
air_rate = _hook("air_rate")
factors = _hook("factors")
loads = _hook("loads")
supply = _hook("supply")
gauge = _hook("gauge")
motor = _hook("motor")
wrench = _hook("wrench")
wrench_body = _hook("wrench_body")
torque = _hook("torque")
field = _hook("field")
sample = _hook("sample")
settle = _hook("settle")
substeps = _hook("substeps")
contact = _hook("contact")
contact_forces = _hook("contact_forces")
event = _hook("event")
asleep = _hook("asleep")
wind = _hook("wind")


def initial_memory(e: Any) -> tuple:
    """What an effect remembers before the first exchange."""
    return e.initial_memory() if hasattr(e, "initial_memory") else ()


def _written_out(
    fold: str, hook: str, arguments: str, call: str, result: str, default: str = "", more: str = ""
) -> Callable:
    """A function of (effects, memory, arguments) that calls `hook` for each effect that has it.

    `call` is the line for effect number {i}, with hook function f{i}, and `more` that for every one but the first
    where it differs; `result` is the expression returned at the end; `default` that if no effect has the hook.
    """

    signature = f"{fold}(effects, memory, {arguments})"

    def generate(effects: Any, *_rest: Any) -> Callable:
        active = [(i, e.instance_class) for i, e in enumerate(effects.types)]
        for effect in effects.types:
            if not any(effect.instance_class in registered for registered in HOOKS.values()):
                raise TypingError(
                    f"effect {effect.instance_class.__name__} has no hook: the module of its hooks is not imported"
                )
        names: dict[str, Any] = {"add": add, "apply": apply, "beside": beside, "in_world": in_world}
        lines: list[str] = []
        members = [f"memory[{i}]" for i, _ in active]
        for i, parameters in active:
            if parameters in HOOKS[hook]:
                names[f"f{i}"] = HOOKS[hook][parameters]
                lines.append((more if lines and more else call).format(i=i))
                members[i] = f"m{i}"
        end = default if default and not lines else result
        if end == "memory":
            end = f"({', '.join(members)}{',' if len(members) == 1 else ''})"
        return compile_source(signature, names, *lines, f"return {end}")

    return generated_overload(signature, generate, f"The effects' `{hook}`, one after the other.", inline=True)


def _chain(hook: str, before: str = "") -> Callable:
    call = f"value = f{{i}}(effects[{{i}}], memory[{{i}}], {before}value)"
    return _written_out(f"all_{hook}", hook, f"{before}value", call, "value")


all_body = _chain("body")
all_air = _chain("air", "s, ")
all_air_rate = _chain("air_rate", "s, ")
all_factors = _chain("factors", "s, ")
all_loads = _chain("loads", "s, factors, ")
all_supply = _chain("supply")
all_winds = _chain("wind")
all_torques = _written_out(
    "all_torques",
    "torque",
    "s, rotors, torque",
    "torque = add(torque, f{i}(effects[{i}], memory[{i}], s, rotors))",
    "torque",
)
all_body_wrenches = _written_out(
    "all_body_wrenches",
    "wrench_body",
    "s, rotors, thrust, torque",
    "force, moment = f{i}(effects[{i}], memory[{i}], s, rotors); torque = add(torque, moment)",
    "(apply(s.R_world_body, beside(thrust, force)), torque)",
    default="(in_world(thrust, s.R_world_body), torque)",
    more="w{i} = f{i}(effects[{i}], memory[{i}], s, rotors); force, torque = add(force, w{i}[0]), add(torque, w{i}[1])",
)
all_wrenches = _written_out(
    "all_wrenches",
    "wrench",
    "s, rotors, force, torque",
    "w{i} = f{i}(effects[{i}], memory[{i}], s, rotors); force, torque = add(force, w{i}[0]), add(torque, w{i}[1])",
    "(force, torque)",
)
all_fields = _written_out(
    "all_fields",
    "field",
    "value",
    "value = add(value, f{i}(effects[{i}], memory[{i}]))",
    "value",
)
all_motors = _written_out(
    "all_motors",
    "motor",
    "s, loads, voltage, default",
    "value = f{i}(effects[{i}], memory[{i}], s, loads, voltage)",
    "value",
    default="default",
)
all_gauges = _written_out(
    "all_gauges",
    "gauge",
    "default",
    "value = f{i}(effects[{i}], memory[{i}])",
    "value",
    default="default",
)
all_samples = _written_out(
    "all_samples",
    "sample",
    "s, rotors, key, tick, interval",
    "m{i} = f{i}(effects[{i}], memory[{i}], s, rotors, key, tick, interval)",
    "memory",
)
all_settled = _written_out(
    "all_settled",
    "settle",
    "motion, h",
    "m{i} = f{i}(effects[{i}], memory[{i}], motion, h)",
    "memory",
)
all_substeps = _written_out(
    "all_substeps",
    "substeps",
    "motion, h",
    "n = f{i}(effects[{i}], memory[{i}], motion, h)",
    "n",
    default="1",
    more="n = max(n, f{i}(effects[{i}], memory[{i}], motion, h))",
)
all_events = _written_out(
    "all_events",
    "event",
    "after",
    "happened = f{i}(effects[{i}], memory[{i}], after[{i}])",
    "happened",
    default="False",
    more="happened = happened or f{i}(effects[{i}], memory[{i}], after[{i}])",
)
all_contacts = _written_out(
    "all_contacts",
    "contact",
    "s",
    "touching = f{i}(effects[{i}], memory[{i}], s)",
    "touching",
    default="False",
    more="touching = touching or f{i}(effects[{i}], memory[{i}], s)",
)
all_contact_forces = _written_out(
    "all_contact_forces",
    "contact_forces",
    "motion",
    "forces = f{i}(effects[{i}], memory[{i}], motion)",
    "forces",
    default="()",
    more="forces = forces + f{i}(effects[{i}], memory[{i}], motion)",
)
all_asleep = _written_out(
    "all_asleep",
    "asleep",
    "motion, h",
    "sleeping = f{i}(effects[{i}], memory[{i}], motion, h)",
    "sleeping",
    default="True",
    more="sleeping = sleeping and f{i}(effects[{i}], memory[{i}], motion, h)",
)


def _all_calm(effects: Any, *_rest: Any) -> Callable:
    both = HOOKS["substeps"], HOOKS["asleep"]
    stiff = [i for i, e in enumerate(effects.types) if all(e.instance_class in hook for hook in both)]
    names = {f"f{i}": HOOKS["asleep"][effects.types[i].instance_class] for i in stiff}
    calm = " and ".join(f"f{i}(effects[{i}], memory[{i}], motion, h)" for i in stiff)
    return compile_source("all_calm(effects, memory, motion, h)", names, f"return {calm or 'True'}")


all_calm = generated_overload(
    "all_calm(effects, memory, motion, h)",
    _all_calm,
    "Whether every effect that is stiff is asleep.",
    inline=True,
)


def _without_sleepers(effects: Any, _: Any) -> Callable:
    kept = "".join(f"values[{i}], " for i, e in enumerate(effects.types) if e.instance_class not in HOOKS["asleep"])
    return compile_source("without_sleepers(effects, values)", {}, f"return ({kept})")


without_sleepers = generated_overload(
    "without_sleepers(effects, values)",
    _without_sleepers,
    "The members of `values`, one for each effect, that belong to effects that never sleep.",
    inline=True,
)
