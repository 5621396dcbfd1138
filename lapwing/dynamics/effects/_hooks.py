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
    battery              (e, memory, power) -> (voltage [V] for the motors under a power [W], its state: (charge,
                         terminal voltage [V], current [A], temperature [K]; NaN: not modelled)); one effect only
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
    memory_rate          (e, memory, s, rotors) -> rate of its memory, which is integrated with the motion in every step
    decay_rate           (e, memory, motion, body, layout) -> [1/s] bound of the rate at which it damps the motion, or
                         at which that memory decays, for stability
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
(`lapwing.dynamics.vehicles.multirotor_stepper`). An effect with `memory_rate` never sleeps. If it has named inputs
(`_external_inputs`), its rate is that of its own memory.

The discrete state of an effect is a tuple of floats, at first `initial_discrete_state()` of its parameter class, or ().
"""

from collections.abc import Callable
from typing import Any

from numba.core.errors import TypingError

from lapwing.dynamics.effects._axes import beside, in_world
from lapwing.dynamics.vector import add, apply
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
battery = _hook("battery")
motor = _hook("motor")
wrench = _hook("wrench")
wrench_body = _hook("wrench_body")
torque = _hook("torque")
field = _hook("field")
discrete_update = _hook("discrete_update")
timed_update = _hook("timed_update")
break_time = _hook("break_time")
wrench_and_rate = _hook("wrench_and_rate")
memory_rate = _hook("memory_rate")
decay_rate = _hook("decay_rate")
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
        if type(e) in HOOKS["battery"]:
            result = python_function(HOOKS["battery"][type(e)])(e, own, 0.0)[1]
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
        names: dict[str, Any] = {"add": add, "apply": apply, "beside": beside, "in_world": in_world, "math": math}
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
    """Return the function that passes `value` through all hooks."""
    call = f"value = f{{i}}(effects[{{i}}], memory[{{i}}], {before}value)"
    return _generate_calls(f"all_{hook}", hook, f"{before}value", call, "value")


def _update(name: str, hook: str, arguments: str) -> Callable:
    """Return the function that replaces the memory of each effect with the result of its hook."""
    return _generate_calls(
        name, hook, arguments, f"m{{i}} = f{{i}}(effects[{{i}}], memory[{{i}}], {arguments})", "memory"
    )


def _combine(name: str, hook: str, arguments: str, combination: str, default: str, parameters: str = "") -> Callable:
    """Return the function that combines the results of all hooks.

    Args:
        name: of the function.
        hook: called with effect, memory and `arguments`.
        arguments: of the hook.
        combination: expression of `value` and the next {call}.
        default: result if no effect has the hook.
        parameters: further parameters of the function.
    """
    call = f"f{{i}}(effects[{{i}}], memory[{{i}}], {arguments})"
    signature = ", ".join(filter(None, (arguments, parameters)))
    more = "value = " + combination.format(call=call)
    return _generate_calls(name, hook, signature, f"value = {call}", "value", default=default, more=more)


_ADD_WRENCH = (
    "w{i} = f{i}(effects[{i}], memory[{i}], s, rotors); force, torque = add(force, w{i}[0]), add(torque, w{i}[1])"
)
all_mass_properties = _chain("mass_properties")
all_air = _chain("air", "s, ")
all_air_rate = _chain("air_rate", "s, ")
all_load_factors = _chain("load_factors", "s, ")
all_loads = _chain("loads", "s, factors, ")
all_winds = _chain("wind")
next_breakpoint = _chain("break_time", "t, h, ")
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
    more=_ADD_WRENCH,
)
all_wrenches = _generate_calls("all_wrenches", "wrench", "s, rotors, force, torque", _ADD_WRENCH, "(force, torque)")
all_fields = _generate_calls(
    "all_fields", "field", "value", "value = add(value, f{i}(effects[{i}], memory[{i}]))", "value"
)
all_motors = _combine("all_motors", "motor", "s, loads, voltage", "{call}", "default", "default")
_READ = "read = f{i}(effects[{i}], memory[{i}], power)"
battery_voltage = _generate_calls("battery_voltage", "battery", "power", _READ, "read[0]", default="math.inf")
battery_state = _generate_calls("battery_state", "battery", "power, default", _READ, "read[1]", default="default")
all_discrete_updates = _update("all_discrete_updates", "discrete_update", "s, rotors, key, tick, interval")
all_timed_updates = _update("all_timed_updates", "timed_update", "t")
all_substeps = _combine("all_substeps", "substeps", "motion, h", "max(value, {call})", "1")
all_decay_rates = _combine("all_decay_rates", "decay_rate", "motion, body, layout", "max(value, {call})", "0.0")
all_contacts = _combine("all_contacts", "contact", "s", "value or {call}", "False")
all_contact_forces = _combine("all_contact_forces", "contact_forces", "motion", "value + {call}", "()")
all_switches = _combine("all_switches", "switches", "s, voltage, h", "value or {call}", "False")
all_can_sleep = _combine("all_can_sleep", "can_sleep", "", "value and {call}", "True")
all_sleeping = _generate_calls(
    "all_sleeping",
    "is_sleeping",
    "motion, h",
    "sleeping = f{i}(effects[{i}], motion, h)",
    "sleeping",
    default="True",
    more="sleeping = sleeping and f{i}(effects[{i}], motion, h)",
)
