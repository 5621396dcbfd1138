"""The steps of a multirotor's exchange interval: in the air, and under error control in contact."""

import math
import sys

from lapwing.dynamics.effects import _hooks as hooks
from lapwing.dynamics.integrators import SHORTEST, shorter
from lapwing.dynamics.vehicles.multirotor_equations import FORMS, MultirotorDrive, MultirotorParameters, evaluate, seen
from lapwing.kernels import always_inline
from lapwing.kernels import noinline as never_inlined
from lapwing.kernels.codegen import map_tuple, overload_for
from lapwing.kernels.state_tree import finite, relative_difference

FASTEST_LAG = 1.0  # lag rate times step up to which no step is split: every explicit method is stable to 2


def _step(method, drive, t, x, h):
    raise NotImplementedError("compiled code only")


@overload_for(_step, inline=True)
def _step_inlined(method, drive, t, x, h):
    one_step = sys.modules[method.instance_class.__module__].step
    form = FORMS[x.instance_class]
    its_rate, held = form.rate, form.held
    # inlined into `advance`, so that what a whole interval has in common is computed once
    return lambda method, drive, t, x, h: held(drive, one_step(its_rate, drive, t, x, h))


@always_inline
def within(limit, voltage, _):
    """The nearest voltage [V] that the controllers can ask for."""
    return min(max(voltage, 0.0), limit)


@always_inline
def _airborne(p, body, memory, voltage):
    """The drive without the effects that can sleep."""
    effects = hooks.without_sleepers(p.effects, p.effects)
    kept = hooks.without_sleepers(p.effects, memory)
    return MultirotorDrive(MultirotorParameters(p.body, p.layout, effects, p.tolerance), body, kept, voltage)


@always_inline
def _awake_step(method, drive, t, x, h):
    """(state's form, memory) a step later with every effect taking part."""
    x = _step(method, drive, t, x, h)
    return x, hooks.all_post_steps(drive.parameters.effects, drive.memory, seen(drive.parameters.layout, x), h)


@never_inlined
def _stiff_steps(method, drive, t, x, h, end):
    """(state's form, memory) at the time `end`, by parts of steps whose error is controlled (theory.md, eq. (2.33)).

    Each part is taken whole and in halves, effects' memories included: what they differ by is its error. Halves are
    kept, and are no longer than h and than effects ask for.
    """
    p, body, memory, voltage = drive
    allowed, part = p.tolerance, 2.0 * h
    smallest = SHORTEST * allowed
    while True:
        left = end - t
        part = min(part, 2.0 * h / hooks.all_substeps(p.effects, memory, seen(p.layout, x), h))
        last = part > (1.0 - 1e-9) * left
        taken = left if last else part
        half = 0.5 * taken
        y, settled, whole, at_once, start, length = x, memory, x, memory, t, taken
        for k in range(3):  # one call in the code: passing arguments to three took a sixth of the time
            y, settled = _awake_step(method, MultirotorDrive(p, body, settled, voltage), start, y, length)
            if k == 0:
                y, settled, whole, at_once, length = x, memory, y, settled, half
            else:
                start = t + half
        sound = finite(y)
        error = max(relative_difference(y, whole), relative_difference(settled, at_once)) if sound else math.inf
        if taken > smallest and (error > allowed or hooks.any_discontinuity(p.effects, memory, settled)):
            part = shorter(taken, error, allowed)
            continue
        x, memory = y, settled
        if last or not sound:
            return x, memory
        t += taken
        if error < allowed / 32.0:
            part = 2.0 * taken


@always_inline
def begin(p, key, tick, state, command, interval):
    """The drive of the exchange interval `tick`, with what effects draw for it; arguments as of `advance`."""
    layout, memory = p.layout, state.memory
    voltage = map_tuple(within, layout.max_voltage, command, command)
    before = _airborne(p, hooks.all_mass_properties(p.effects, memory, p.body), memory, voltage)
    s, rotors, _, _ = evaluate(before, tick * interval, seen(layout, state.motion))
    memory = hooks.all_discrete_updates(p.effects, memory, s, rotors, key, tick, interval)
    return MultirotorDrive(p, hooks.all_mass_properties(p.effects, memory, p.body), memory, voltage)


@always_inline
def parts(layout, h):
    """How many parts a step of h [s] is split into for the motors' lag."""
    return max(1, math.ceil(h * layout.lag_rate / FASTEST_LAG))


@always_inline
def airborne_step(method, drive, t, x, h):
    """The state's form a step later, without the effects that can sleep."""
    return _step(method, _airborne(drive.parameters, drive.body, drive.memory, drive.voltage), t, x, h)


@always_inline
def steps(method, drive, x, start, end, h, first, n):
    """(state's form, memory) at the `end` [s] of an interval that begins at `start`, from step `first` of its n on."""
    p, body, memory, voltage = drive
    layout, airborne = p.layout, _airborne(p, body, memory, voltage)
    for i in range(first, n):
        if hooks.all_sleeping(p.effects, memory, seen(layout, x), h):
            x = _step(method, airborne, start + i * h, x, h)
            continue
        drive = MultirotorDrive(p, body, memory, voltage)
        if not hooks.all_stiff_sleeping(p.effects, memory, seen(layout, x), h):
            x, memory = _stiff_steps(method, drive, start + i * h, x, h, end)
            break
        x, memory = _awake_step(method, drive, start + i * h, x, h)
    return x, memory
