"""Hooks of effects, and their combination without run-time cost.

The effects of a scene are a tuple of parameter NamedTuples, one per active effect, in the order of evaluation. A tuple
of equal length holds the discrete state of each effect. An effect registers compiled functions ("hooks") for its
parameter type. When the plant is compiled, the calls are generated from the types in the tuple, so an effect that is
not in the tuple is not in the machine code.

Hooks of one evaluation, in order:

    air                  (e, memory, s, air) -> Air                  density and wind at the vehicle
    air_rate             (e, memory, s, rate_body) -> rate_body      [rad/s] rotation of the air
    load_factors         (e, memory, s, factors) -> Factors          on thrust and torque of each rotor
    loads                (e, memory, s, factors, loads) -> Loads     thrust and torque of each rotor, added to loads
    supply_voltage       (e, memory, voltage) -> voltage             [V] available to the motors
    battery_state        (e, memory) -> (charge, voltage [V], current [A], temperature [K]); NaN: not modelled
    motor                (e, memory, s, loads, voltage) -> (acceleration, current, power) of each rotor; one effect only
    wrench               (e, memory, s, rotors) -> (force_world [N], torque_body [N m]) at the centre of mass
    wrench_body          (e, memory, s, rotors) -> (force_body [N], torque_body [N m])
    torque               (e, memory, s, rotors) -> torque_body [N m]
    field                (e, memory) -> acceleration of gravity, world [m/s^2], for models of several bodies

Hooks between evaluations:

    mass_properties      (e, memory, body) -> MassProperties         for the next communication step
    discrete_update      (e, memory, s, rotors, key, tick, interval) -> memory    once per communication step, before
                         its first integrator step; s and rotors exclude effects that can sleep
    is_sleeping          (e, motion, h) -> bool                      True if the effect cannot act in the next step
    can_sleep            (e, memory) -> bool                         False while its memory keeps the effect awake even
                         if `is_sleeping`; constant while steps are taken without the effect
    substeps             (e, memory, motion, h) -> int               least number of substeps of a stiff effect
    wrench_and_rate      (e, memory, motion) -> (force_world, torque_body, rate of its memory)    of a stiff effect
                         whose memory is integrated with the motion; the force is that of its wrench
    switches             (e, memory, s, voltage, h) -> bool          True if loads or motors can jump or have a kink in
                         the next h [s], at a moment that depends on the motion; voltage as of `motor`
    timed_update         (e, memory, t) -> memory                    of an effect that changes at a given moment
    break_time           (e, memory, t, h, value) -> the lesser of value and the first time after t [s] at which the
                         loads jump or have a kink: steps, of at most h [s], end and timed updates are made there
    contact              (e, memory, s) -> bool                      True if the vehicle touches the ground
    contact_forces       (e, memory, motion) -> ((place [m], force [N]) of each contact point), world
    wind                 (e, memory, wind) -> wind                   [m/s] world, for the log only

While all effects that can sleep are sleeping, steps are taken without them. While a stiff one is awake or one switches,
steps are taken under error control, which includes memories that have a rate
(`lapwing.dynamics.vehicles.multirotor_stepper`).

The discrete state of an effect is a tuple of floats, at first `initial_discrete_state()` of its parameter class, or ().
"""

from collections.abc import Callable
from typing import Any, NamedTuple

from numba.core.errors import TypingError

from lapwing.dynamics.effects._axes import beside, in_world
from lapwing.dynamics.vector import Vec3, add, apply
from lapwing.kernels import DispatchTable, always_inline, math, python_function
from lapwing.kernels.codegen import compile_source, generic

HOOKS: dict[str, DispatchTable] = {}


def _hook(name: str) -> Callable:
    registered = HOOKS.setdefault(name, DispatchTable())

    def for_types(*parameters: type) -> Callable:
        def register(function: Callable) -> Callable:
            compiled = always_inline(function)
            registered.update(dict.fromkeys(parameters, compiled))
            return compiled

        return register

    return for_types


mass_properties = _hook("mass_properties")
air = _hook("air")
air_rate = _hook("air_rate")
load_factors = _hook("load_factors")
loads = _hook("loads")
supply_voltage = _hook("supply_voltage")
battery_state = _hook("battery_state")
motor = _hook("motor")
wrench = _hook("wrench")
wrench_body = _hook("wrench_body")
torque = _hook("torque")
field = _hook("field")
discrete_update = _hook("discrete_update")
timed_update = _hook("timed_update")
break_time = _hook("break_time")
wrench_and_rate = _hook("wrench_and_rate")
substeps = _hook("substeps")
contact = _hook("contact")
contact_forces = _hook("contact_forces")
is_sleeping = _hook("is_sleeping")
can_sleep = _hook("can_sleep")
switches = _hook("switches")
wind = _hook("wind")


def initial_discrete_state(e: Any) -> tuple:
    """Return the discrete state of an effect before the first tick."""
    return e.initial_discrete_state() if hasattr(e, "initial_discrete_state") else ()


def initial_battery_state(effects: tuple, memory: tuple, voltage: float) -> tuple:
    """Return (charge, voltage [V], current [A], temperature [K]) before the first tick; NaN: not modelled.

    Args:
        effects: parameters of the effects.
        memory: their discrete state.
        voltage: voltage without a battery [V].
    """
    result = (math.nan, voltage, 0.0, math.nan)
    for e, own in zip(effects, memory, strict=True):
        if type(e) in HOOKS["battery_state"]:
            result = python_function(HOOKS["battery_state"][type(e)])(e, own)
    return result


def _generate_calls(
    fold: str, hook: str, arguments: str, call: str, result: str, default: str = "", more: str = ""
) -> Callable:
    """Return a function of (effects, memory, arguments) that calls `hook` of each effect that has it.

    `call` is the line for effect number {i} with hook function f{i}; `more` replaces it after the first, if it differs.
    `result` is the returned expression; `default` that if no effect has the hook.
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

    generate.__name__ = generate.__qualname__ = fold
    generate.__doc__ = f"Return the result of the effects' `{hook}`, one after the other."
    return generic(inline=True)(generate)


def _chain(hook: str, before: str = "") -> Callable:
    call = f"value = f{{i}}(effects[{{i}}], memory[{{i}}], {before}value)"
    return _generate_calls(f"all_{hook}", hook, f"{before}value", call, "value")


all_mass_properties = _chain("mass_properties")
all_air = _chain("air", "s, ")
all_air_rate = _chain("air_rate", "s, ")
all_load_factors = _chain("load_factors", "s, ")
all_loads = _chain("loads", "s, factors, ")
all_supply_voltage = _chain("supply_voltage")
all_winds = _chain("wind")
all_torques = _generate_calls(
    "all_torques",
    "torque",
    "s, rotors, torque",
    "torque = add(torque, f{i}(effects[{i}], memory[{i}], s, rotors))",
    "torque",
)
all_body_wrenches = _generate_calls(
    "all_body_wrenches",
    "wrench_body",
    "s, rotors, thrust, torque",
    "force, moment = f{i}(effects[{i}], memory[{i}], s, rotors); torque = add(torque, moment)",
    "(apply(s.R_world_body, beside(thrust, force)), torque)",
    default="(in_world(thrust, s.R_world_body), torque)",
    more="w{i} = f{i}(effects[{i}], memory[{i}], s, rotors); force, torque = add(force, w{i}[0]), add(torque, w{i}[1])",
)
all_wrenches = _generate_calls(
    "all_wrenches",
    "wrench",
    "s, rotors, force, torque",
    "w{i} = f{i}(effects[{i}], memory[{i}], s, rotors); force, torque = add(force, w{i}[0]), add(torque, w{i}[1])",
    "(force, torque)",
)
all_fields = _generate_calls(
    "all_fields",
    "field",
    "value",
    "value = add(value, f{i}(effects[{i}], memory[{i}]))",
    "value",
)
all_motors = _generate_calls(
    "all_motors",
    "motor",
    "s, loads, voltage, default",
    "value = f{i}(effects[{i}], memory[{i}], s, loads, voltage)",
    "value",
    default="default",
)
all_battery_states = _generate_calls(
    "all_battery_states",
    "battery_state",
    "default",
    "value = f{i}(effects[{i}], memory[{i}])",
    "value",
    default="default",
)
all_discrete_updates = _generate_calls(
    "all_discrete_updates",
    "discrete_update",
    "s, rotors, key, tick, interval",
    "m{i} = f{i}(effects[{i}], memory[{i}], s, rotors, key, tick, interval)",
    "memory",
)
all_timed_updates = _generate_calls(
    "all_timed_updates", "timed_update", "t", "m{i} = f{i}(effects[{i}], memory[{i}], t)", "memory"
)
next_breakpoint = _generate_calls(
    "next_breakpoint", "break_time", "t, h, value", "value = f{i}(effects[{i}], memory[{i}], t, h, value)", "value"
)
all_substeps = _generate_calls(
    "all_substeps",
    "substeps",
    "motion, h",
    "n = f{i}(effects[{i}], memory[{i}], motion, h)",
    "n",
    default="1",
    more="n = max(n, f{i}(effects[{i}], memory[{i}], motion, h))",
)
all_contacts = _generate_calls(
    "all_contacts",
    "contact",
    "s",
    "touching = f{i}(effects[{i}], memory[{i}], s)",
    "touching",
    default="False",
    more="touching = touching or f{i}(effects[{i}], memory[{i}], s)",
)
all_contact_forces = _generate_calls(
    "all_contact_forces",
    "contact_forces",
    "motion",
    "forces = f{i}(effects[{i}], memory[{i}], motion)",
    "forces",
    default="()",
    more="forces = forces + f{i}(effects[{i}], memory[{i}], motion)",
)
all_switches = _generate_calls(
    "all_switches",
    "switches",
    "s, voltage, h",
    "switching = f{i}(effects[{i}], memory[{i}], s, voltage, h)",
    "switching",
    default="False",
    more="switching = switching or f{i}(effects[{i}], memory[{i}], s, voltage, h)",
)
all_sleeping = _generate_calls(
    "all_sleeping",
    "is_sleeping",
    "motion, h",
    "sleeping = f{i}(effects[{i}], motion, h)",
    "sleeping",
    default="True",
    more="sleeping = sleeping and f{i}(effects[{i}], motion, h)",
)
all_can_sleep = _generate_calls(
    "all_can_sleep",
    "can_sleep",
    "",
    "able = f{i}(effects[{i}], memory[{i}])",
    "able",
    default="True",
    more="able = able and f{i}(effects[{i}], memory[{i}])",
)


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
