"""Integrator steps of a multirotor's communication step, with error control in contact."""

import math
from typing import Any, NamedTuple

from lapwing.dynamics.effects import _hooks as hooks
from lapwing.dynamics.effects import _stiff_effects as stiff_effects
from lapwing.dynamics.effects._rotor_sums import total
from lapwing.dynamics.integrators import (
    INCREMENTS,
    SHORTEST,
    STEPS,
    CompensatedSum,
    add,
    exact,
    extrapolate,
    is_compensated,
    rounded,
    value_of,
)
from lapwing.dynamics.vehicles.multirotor_equations import (
    FORMULATIONS,
    Formulation,
    MultirotorParameters,
    StepInputs,
    accelerations_of_state,
    evaluate,
    has_battery,
    inputs,
    motion_of,
)
from lapwing.kernels import always_inline, kernel
from lapwing.kernels import noinline as never_inlined
from lapwing.kernels.codegen import dispatch, generic, map_tuple, reduce_tuple
from lapwing.kernels.state_tree import finite, relative_difference

BREAK_ROUNDING = 1e-6  # relative to a communication step: breakpoints this close to its ends count as the ends
SAG_RATE = 4.0  # largest relative rate of the battery's sag, over the rate of the motors' lag


@generic(inline=True)
def _step(method, u, t, x, h):
    if is_compensated(x):
        return _compensated_step(INCREMENTS[method.instance_class], FORMULATIONS[x.types[0].instance_class])
    one_step, formulation = STEPS[method.instance_class], FORMULATIONS[x.instance_class]
    its_rate, project = formulation.rate, formulation.project
    # inlined into `advance`, so that constants of an interval are computed once
    return lambda method, u, t, x, h: project(u, one_step(its_rate, u, t, x, h))


def _compensated_step(increment, formulation):
    its_rate, project = formulation.rate, formulation.project

    def step(method, u, t, x, h):
        value, remainder = add(x, increment(its_rate, u, t, x.value, h))
        return CompensatedSum(project(u, value), remainder)

    return step


_switches_of_state = dispatch(FORMULATIONS, 1, "switches")
_rate_of_state = dispatch(FORMULATIONS, 2, "rate")
_project_state = dispatch(FORMULATIONS, 1, "project")


@always_inline
def _near(c, near, voltage, _):
    limit, reach = c
    return near or abs(voltage - limit) <= reach


@generic(inline=True)
def _effects_switch(effects, u, t, motion, h):
    """Return True if an effect can switch, or the battery can begin or cease to limit a motor, within h [s]."""
    if has_battery(effects):

        def switch(effects, u, t, motion, h):
            s, rotors, _, _ = evaluate(u, t, motion)
            limit = hooks.battery_voltage(effects, u.memory, total(rotors.power))
            sag = abs(hooks.battery_voltage(effects, u.memory, 0.0) - limit)
            near = limit, SAG_RATE * s.layout.lag_rate * h * sag
            limiting = reduce_tuple(_near, near, False, u.voltage, u.voltage)
            return limiting or hooks.all_switches(effects, u.memory, s, rotors.voltage, h)

        return switch
    if not any(e.instance_class in hooks.HOOKS["switches"] for e in effects.types):
        return lambda effects, u, t, motion, h: False
    return lambda effects, u, t, motion, h: hooks.all_switches(effects, u.memory, inputs(u, t, motion), u.voltage, h)


@always_inline
def switches(u, t, x, h):
    """Return True if the loads can have a state-dependent jump or kink within h [s] after t [s]."""
    p, seen = u.parameters, motion_of(u.parameters.layout, x)
    return _switches_of_state(p.layout, x, h) or _effects_switch(p.effects, u, t, seen, h)


@always_inline
def within(limit, voltage, _):
    """Clamp a voltage [V] to the controllers' range."""
    return min(max(voltage, 0.0), limit)


@always_inline
def _airborne(p, body, memory, voltage):
    """Return the step inputs without the effects that can sleep."""
    effects = stiff_effects.without_sleepers(p.effects, p.effects)
    awake = stiff_effects.without_sleepers(p.effects, memory)
    return StepInputs(MultirotorParameters(p.body, p.layout, effects, p.tolerance, p.summation), body, awake, voltage)


class AwakeState(NamedTuple):
    """Motion with the memories of effects that have a rate: a formulation during a step."""

    motion: Any  # an instance of another class in FORMULATIONS
    memory: tuple


@always_inline
def _wake(layout, x):
    return motion_of(layout, x.motion)


@always_inline
def _with_memories(u, x):
    """Return the step inputs with the memories of the state."""
    p, body, memory, voltage = u
    return StepInputs(p, body, stiff_effects.with_integrated(p.effects, memory, x.memory), voltage)


@generic(inline=True)
def _memory_rates(effects, stiff, u, t, motion):
    """Return the rates of all memories that have one; `u` has the wrenches that `stiff` belongs to."""
    if not stiff_effects.have_memory_rate(effects):
        return lambda effects, stiff, u, t, motion: stiff_effects.all_rates(effects, u.memory, stiff, t, t)

    def rates(effects, stiff, u, t, motion):
        s, rotors, _, _ = evaluate(u, t, motion)  # the same numbers as in the rate of the motion
        return stiff_effects.all_rates(effects, u.memory, stiff, s, rotors)

    return rates


@always_inline
def with_known_wrenches(u, motion):
    """Return (step inputs with the wrenches of stiff effects in their place, the rate of each one's memory, or ())."""
    p, body, memory, voltage = u
    effects, stiff = stiff_effects.with_wrenches(p.effects, memory, motion)
    parameters = MultirotorParameters(p.body, p.layout, effects, p.tolerance, p.summation)
    return StepInputs(parameters, body, memory, voltage), stiff


@kernel
def _awake_rate(u, t, x):
    u = _with_memories(u, x)
    effects, motion = u.parameters.effects, motion_of(u.parameters.layout, x.motion)
    known, stiff = with_known_wrenches(u, motion)
    return AwakeState(_rate_of_state(known, t, x.motion), _memory_rates(effects, stiff, known, t, motion))


@always_inline
def _project_awake(u, x):
    return AwakeState(_project_state(u, x.motion), x.memory)


@always_inline
def _awake_accelerations(u, t, x):
    return accelerations_of_state(_with_memories(u, x), t, x.motion)


FORMULATIONS[AwakeState] = Formulation(_wake, _awake_rate, _project_awake, _awake_accelerations)


@always_inline
def _growth(error, allowed):
    """Return the length of the next substep over that of the last (theory, eq. (2.33))."""
    return min(max(0.9 * math.sqrt(math.sqrt(allowed / max(error, 1e-3 * allowed))), 0.1), 2.0)


@generic(inline=True)
def _origin(x, t):
    """Return the moment from which time is counted, so that its sum does not round off: t for compensated sums."""
    return (lambda x, t: t) if is_compensated(x) else (lambda x, t: 0.0)


@never_inlined
def _stiff_steps(method, u, t, x, h, end):
    """Return (motion, memory) at the time `end` by step doubling (theory, eq. (2.33)).

    Each substep is taken whole and in halves, with the effects' memories that have a rate; the difference is the error.
    The result of the halves is kept; they are no longer than h and than effects require. Compensated sums include the
    time, which is that from the first step.
    """
    p, memory = u.parameters, u.memory
    allowed, substep = p.tolerance, 2.0 * h
    smallest = SHORTEST * allowed
    x = exact(p.summation, method, AwakeState(x, stiff_effects.all_integrated(p.effects, memory)))
    origin = _origin(x, t)
    t, end = t - origin, end - origin
    while True:
        left = end - t
        substep = min(substep, 2.0 * h / hooks.all_substeps(p.effects, memory, motion_of(p.layout, value_of(x)), h))
        last = substep > (1.0 - 1e-9) * left
        size = left if last else substep
        half = 0.5 * size
        y, whole, start, length = x, x, origin + t, size
        for k in range(3):  # one call site: passing arguments at three took 1/6 of the time
            y = _step(method, u, start, y, length)
            if k == 0:
                y, whole, length = x, y, half
            else:
                start = origin + (t + half)
        sound = finite(y)
        error = relative_difference(value_of(y), value_of(whole)) if sound else math.inf
        substep = size * _growth(error, allowed)
        if size > smallest and error > allowed:
            continue
        x = extrapolate(method, y, whole)
        if last or not sound:
            x = rounded(x)
            return x.motion, stiff_effects.with_integrated(p.effects, memory, x.memory)
        t += size


@always_inline
def begin(p, key, tick, state, command, interval):
    """Return the step inputs of the communication step `tick`, with the random draws of effects. See `advance`."""
    layout, memory = p.layout, state.memory
    voltage = map_tuple(within, layout.max_voltage, command, command)
    before = _airborne(p, hooks.all_mass_properties(p.effects, memory, p.body), memory, voltage)
    s, rotors, _, _ = evaluate(before, tick * interval, motion_of(layout, state.motion))
    memory = hooks.all_discrete_updates(p.effects, memory, s, rotors, key, tick, interval)
    memory = hooks.all_timed_updates(p.effects, memory, (tick + BREAK_ROUNDING) * interval)
    return StepInputs(p, hooks.all_mass_properties(p.effects, memory, p.body), memory, voltage)


@generic(inline=True)
def _step_with_memories(effects, method, u, t, x, h):
    """Return (motion, memory) a step later."""
    if not stiff_effects.have_memory_rate(effects):
        return lambda effects, method, u, t, x, h: (_step(method, u, t, x, h), u.memory)

    def step(effects, method, u, t, x, h):
        y = _step(method, u, t, AwakeState(x, stiff_effects.all_integrated(effects, u.memory)), h)
        return y.motion, stiff_effects.with_integrated(effects, u.memory, y.memory)

    return step


@always_inline
def airborne_step(method, u, t, x, h):
    """Return (motion, memory) a step later, without the effects that can sleep."""
    p, body, memory, voltage = u
    airborne = _airborne(p, body, memory, voltage)
    x, awake = _step_with_memories(airborne.parameters.effects, method, airborne, t, x, h)
    return x, stiff_effects.with_awake(p.effects, memory, awake)


@generic(inline=True)
def _mixed_step(effects, method, u, t, x, h):
    """Return (motion, memory) a step later in which some effects sleep but no stiff one is awake."""
    if stiff_effects.only_stiff_sleep(effects):  # there is no such step
        return lambda effects, method, u, t, x, h: (x, u.memory)
    return lambda effects, method, u, t, x, h: _step_with_memories(effects, method, u, t, x, h)


@always_inline
def next_break(p, memory, start, interval, end, h):
    """Return the first breakpoint [s] between `start` and `end` that is not close to either; infinity if there is none.

    `interval` [s] is the communication step, h [s] the longest step.
    """
    rounding = BREAK_ROUNDING * interval
    at = hooks.next_breakpoint(p.effects, memory, start + rounding, h, math.inf)
    return at if start + rounding < at < end - rounding else math.inf


@always_inline
def steps(method, u, x, start, end, h, first, n):
    """Return (motion, discrete state) at the `end` [s] of an interval from `start`, from step `first` of its n.

    Steps end at the effects' breakpoints. The parts of the interval are divided into steps of at most h.
    """
    p, body, memory, voltage = u
    interval, longest = end - start, h
    stop = next_break(p, memory, start, interval, end, longest)
    while True:
        if stop < end:
            n = max(1, math.ceil((stop - start) / longest - BREAK_ROUNDING))
            h = (stop - start) / n
        until = min(stop, end)
        for i in range(first, n):
            seen, u = motion_of(p.layout, x), StepInputs(p, body, memory, voltage)
            switching = switches(u, start + i * h, x, h)
            asleep = hooks.all_sleeping(p.effects, memory, seen, h) and hooks.all_can_sleep(p.effects, memory)
            if asleep and not switching:
                x, memory = airborne_step(method, u, start + i * h, x, h)
                continue
            if switching or not stiff_effects.all_stiff_sleeping(p.effects, memory, seen, h):
                x, memory = _stiff_steps(method, u, start + i * h, x, h, until)
                break
            x, memory = _mixed_step(p.effects, method, u, start + i * h, x, h)
        if not stop < end:
            return x, memory
        memory = hooks.all_timed_updates(p.effects, memory, stop)
        body = hooks.all_mass_properties(p.effects, memory, p.body)
        start = stop
        stop = next_break(p, memory, start, interval, end, longest)
        if not stop < end:
            n = max(1, math.ceil((end - start) / longest - BREAK_ROUNDING))
            h = (end - start) / n
