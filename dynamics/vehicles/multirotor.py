"""The plant: one rigid body with rotors, driven by motor voltages, under the effects that its scene names.

Here stand only the kinematics, Newton's and Euler's equations and the lag of the rotors (theory.md, chapter 1);
every force is an effect (dynamics/effects). All functions are pure. What stands for the motion in the state is a form
(`FORMS`): here one rigid body; `multirotor_multibody` adds five, under the same effects, `advance` and `observe`.
"""

import math
import sys
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from dynamics.effects import _hooks as hooks
from dynamics.effects._axes import thrust_wrench
from dynamics.effects._rotors import total
from dynamics.effects._types import (
    Air,
    AnyMassProperties,
    Factors,
    Loads,
    Motion,
    PerRotor,
    Rotors,
    Situation,
    body_of,
    offset_body,
)
from dynamics.generate import each, implements
from dynamics.integrators import SHORTEST, shorter
from dynamics.kernel import ByClass, kernel, leaf
from dynamics.lie.quaternion import NO_ROTATION, Quaternion, rotation_matrix
from dynamics.tree import apart, finite
from dynamics.vector import ZERO, Vec3
from dynamics.vehicles.newton_euler import newton_euler

if TYPE_CHECKING:  # a process that flies has no need of pydantic
    from dynamics.vehicles.airframe import Airframe

FASTEST_LAG = 1.0  # lag rate times step up to which no step is split: every explicit method is stable to 2
CONTACT_TOLERANCE = 1e-5  # error of a part of a step in contact where nobody says otherwise
STANDARD_DENSITY = 1.225  # [kg/m^3] where no effect says otherwise: 15 degC, 1 atm


class RotorLayout(NamedTuple):
    """The rotors and their motors, as far as the bare plant needs them."""

    x_body: PerRotor  # [m]
    y_body: PerRotor  # [m]
    z_body: PerRotor  # [m]
    reaction_sign: PerRotor  # sign of the torque on the body about the rotor's axis
    inertia: float  # [kg m^2] of one rotor about its axis
    volt_per_speed: float  # [V s/rad] at the rotor = [N m/A]: motor constant over belt ratio
    speed_per_volt: float  # [rad/(s V)]
    lag_rate: float  # [1/s]
    max_voltage: float  # [V]
    no_load_current: float  # [A]
    bodies: Any = ()  # what a form with several bodies needs to know of them
    axis: tuple[Vec3, ...] = ()  # unit vector of each rotor in the body, along which it pushes; () where that is body z


class MultirotorParameters(NamedTuple):
    """A vehicle in a scene."""

    body: AnyMassProperties
    layout: RotorLayout
    effects: tuple  # parameter NamedTuples of the active effects, sorted by name
    tolerance: float  # error of a part of a step while the vehicle is in contact, relative to 1 + size


class MultirotorState(NamedTuple):
    """All that the plant remembers from one exchange to the next."""

    motion: Any  # of a class in FORMS: Motion, or several bodies
    memory: tuple  # one tuple for each effect


class Form(NamedTuple):
    """The compiled functions of a class that stands for the motion in the state."""

    seen: Callable  # (layout, x) -> Motion that effects look at
    rate: Callable  # (drive, t, x) -> tangent of x
    held: Callable  # (drive, x) -> x after a step, brought back onto its constraints
    accelerations: Callable  # (drive, t, x) -> (linear [m/s^2] in the world, angular [rad/s^2] in the body)


FORMS = ByClass()


class MultirotorDrive(NamedTuple):
    """What the rate of change depends on and stays fixed over a step."""

    parameters: MultirotorParameters
    body: AnyMassProperties
    memory: tuple
    voltage: PerRotor  # [V]


class MultirotorObservation(NamedTuple):
    """What can be said about a state beyond the state itself."""

    acceleration_world: Vec3  # [m/s^2] of the motion's position
    angular_acceleration_body: Vec3  # [rad/s^2]
    thrust: PerRotor  # [N]
    torque: PerRotor  # [N m] of the air against each rotor
    rotor_acceleration: PerRotor  # [rad/s^2]
    motor_voltage: PerRotor  # [V]
    motor_current: PerRotor  # [A]
    motor_power: PerRotor  # [W] taken by each motor and its controller
    air_density: float  # [kg/m^3]
    wind_world: Vec3  # [m/s] of the air and of winds that are forces only
    mass: float  # [kg]
    in_contact: bool
    battery: tuple[float, float, float, float]  # charge, voltage [V], current [A], temperature [K]; NaN: not modelled


@leaf
def _lag(s, speed, voltage):
    return s.layout.lag_rate * (s.layout.speed_per_volt * voltage - speed)


@leaf
def _static_current(s, torque, voltage):
    """Current that holds the air's torque (theory.md, eq. (1.14)); none when the controller is off."""
    return torque / s.layout.volt_per_speed + s.layout.no_load_current if voltage > 0.0 else 0.0


@leaf
def _product(c, a, b):
    return a * b


@leaf
def _constant(c, a, b):
    return c


@leaf
def evaluate(drive, t, motion):
    """One evaluation of all effects: (situation, rotors, force_world [N], torque_body [N m])."""
    p, memory = drive.parameters, drive.memory
    layout, speed = p.layout, motion.rotor_speed
    body = drive.body
    R_world_body = rotation_matrix(motion.attitude)
    still = Air(STANDARD_DENSITY, (0.0, 0.0, 0.0))
    s = Situation(t, motion, R_world_body, body, layout, still, ZERO)
    air_rate_body = hooks.all_air_rate(p.effects, memory, s, ZERO)
    s = Situation(t, motion, R_world_body, body, layout, hooks.all_air(p.effects, memory, s, still), air_rate_body)
    # adding to -0.0 changes no number, so the compiler drops it
    one, zero = each(_constant, 1.0, speed, speed), each(_constant, -0.0, speed, speed)
    factors = hooks.all_factors(p.effects, memory, s, Factors(one, one))
    loads = hooks.all_loads(p.effects, memory, s, factors, Loads(zero, zero))
    voltage = hooks.all_supply(p.effects, memory, drive.voltage)
    current = each(_static_current, s, loads.torque, voltage)
    lag = (each(_lag, s, speed, voltage), current, each(_product, 0.0, voltage, current))
    acceleration, current, power = hooks.all_motors(p.effects, memory, s, loads, voltage, lag)
    rotors = Rotors(loads.thrust, loads.torque, acceleration, current, voltage, power)
    thrust, torque = thrust_wrench(layout, loads)
    torque = hooks.all_torques(p.effects, memory, s, rotors, torque)
    force, torque = hooks.all_body_wrenches(p.effects, memory, s, rotors, thrust, torque)
    force, torque = hooks.all_wrenches(p.effects, memory, s, rotors, force, torque)
    return s, rotors, force, torque


@leaf
def rate(drive, t, motion):
    """Tangent of the motion: Newton's and Euler's equations (theory.md, eq. (1.3) to (1.6))."""
    s, rotors, force, torque = evaluate(drive, t, motion)
    linear, angular = newton_euler(s.body, drive, s, force, torque)
    return Motion(motion.velocity_world, motion.omega_body, linear, angular, rotors.acceleration)


@leaf
def _itself(_, motion):
    return motion


@leaf
def accelerations(drive, t, motion):
    """(linear [m/s^2] in the world, angular [rad/s^2] in the body)."""
    s, _, force, torque = evaluate(drive, t, motion)
    return newton_euler(s.body, drive, s, force, torque)


FORMS[Motion] = Form(_itself, rate, _itself, accelerations)


def seen(layout: RotorLayout, x: Any) -> Motion:
    """The vehicle's Motion, whatever form its state has; in compiled code only."""
    raise NotImplementedError("compiled code only")


@implements(seen, inline=True)
def _seen(layout, x):
    found = FORMS[x.instance_class].seen
    return lambda layout, x: found(layout, x)


def _accelerations(drive, t, x):
    raise NotImplementedError("compiled code only")


@implements(_accelerations, inline=True)
def _accelerations_of_form(drive, t, x):
    found = FORMS[x.instance_class].accelerations
    return lambda drive, t, x: found(drive, t, x)


def _step(method, drive, t, x, h):
    raise NotImplementedError("compiled code only")


@implements(_step, inline=True)
def _step_inlined(method, drive, t, x, h):
    one_step = sys.modules[method.instance_class.__module__].step
    form = FORMS[x.instance_class]
    its_rate, held = form.rate, form.held
    # inlined into `advance`, so that what a whole interval has in common is computed once
    return lambda method, drive, t, x, h: held(drive, one_step(its_rate, drive, t, x, h))


@leaf
def _within(limit, voltage, _):
    return min(max(voltage, 0.0), limit)


@leaf
def _airborne(p, body, memory, voltage):
    """The drive without the effects that can sleep."""
    effects = hooks.without_sleepers(p.effects, p.effects)
    kept = hooks.without_sleepers(p.effects, memory)
    return MultirotorDrive(MultirotorParameters(p.body, p.layout, effects, p.tolerance), body, kept, voltage)


@kernel
def _awake_step(method, drive, t, x, h):
    """(state's form, memory) a step later with every effect taking part."""
    x = _step(method, drive, t, x, h)
    return x, hooks.all_settled(drive.parameters.effects, drive.memory, seen(drive.parameters.layout, x), h)


@kernel
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
        drive = MultirotorDrive(p, body, memory, voltage)
        part = min(part, 2.0 * h / hooks.all_substeps(p.effects, memory, seen(p.layout, x), h))
        last = part > (1.0 - 1e-9) * left
        taken = left if last else part
        half = 0.5 * taken
        whole, at_once = _awake_step(method, drive, t, x, taken)
        y, settled = _awake_step(method, drive, t, x, half)
        y, settled = _awake_step(method, MultirotorDrive(p, body, settled, voltage), t + half, y, half)
        sound = finite(y)
        error = max(apart(y, whole), apart(settled, at_once)) if sound else math.inf
        if taken > smallest and (error > allowed or hooks.all_events(p.effects, memory, settled)):
            part = shorter(taken, error, allowed)
            continue
        x, memory = y, settled
        if last or not sound:
            return x, memory
        t += taken
        if error < allowed / 32.0:
            part = 2.0 * taken


@leaf
def begin(p, key, tick, state, command, interval):
    """The drive of the exchange interval `tick`, with what effects draw for it; arguments as of `advance`."""
    layout, memory = p.layout, state.memory
    voltage = each(_within, layout.max_voltage, command, command)
    before = _airborne(p, hooks.all_body(p.effects, memory, p.body), memory, voltage)
    s, rotors, _, _ = evaluate(before, tick * interval, seen(layout, state.motion))
    memory = hooks.all_samples(p.effects, memory, s, rotors, key, tick, interval)
    return MultirotorDrive(p, hooks.all_body(p.effects, memory, p.body), memory, voltage)


@leaf
def parts(layout, h):
    """How many parts a step of h [s] is split into for the motors' lag."""
    return max(1, math.ceil(h * layout.lag_rate / FASTEST_LAG))


@leaf
def airborne_step(method, drive, t, x, h):
    """The state's form a step later, without the effects that can sleep."""
    return _step(method, _airborne(drive.parameters, drive.body, drive.memory, drive.voltage), t, x, h)


@leaf
def steps(method, drive, x, start, end, h, first, n):
    """(state's form, memory) at the `end` [s] of an interval that begins at `start`, from step `first` of its n on."""
    p, body, memory, voltage = drive
    layout, airborne = p.layout, _airborne(p, body, memory, voltage)
    for i in range(first, n):
        if hooks.all_asleep(p.effects, memory, seen(layout, x), h):
            x = _step(method, airborne, start + i * h, x, h)
            continue
        drive = MultirotorDrive(p, body, memory, voltage)
        if not hooks.all_calm(p.effects, memory, seen(layout, x), h):
            x, memory = _stiff_steps(method, drive, start + i * h, x, h, end)
            break
        x, memory = _awake_step(method, drive, start + i * h, x, h)
    return x, memory


@kernel
def advance(method, p, key, tick, state, command, h, n):
    """The state one exchange interval later: n steps of length h [s] under constant voltages.

    Steps are split where the motors' lag is too fast for them.

    Args:
        method: `Method()` of an integrator's module.
        p: MultirotorParameters.
        key: of the vehicle's random numbers (dynamics/noise.py); effects draw at `tick`.
        tick: number of the exchange; it starts at tick n h seconds.
        state: MultirotorState.
        command: voltage [V] of each motor, held within 0 and the highest.
        h: [s] step.
        n: steps in the interval.
    """
    interval = n * h
    start = tick * interval
    drive = begin(p, key, tick, state, command, interval)
    split = parts(p.layout, h)
    x, memory = steps(method, drive, state.motion, start, start + interval, h / split, 0, n * split)
    return MultirotorState(x, memory)


@kernel
def observe(p, tick, interval, state, command):
    """MultirotorObservation of a state at the start of exchange `tick`, under the voltages `command` [V]."""
    layout = p.layout
    voltage = each(_within, layout.max_voltage, command, command)
    body = hooks.all_body(p.effects, state.memory, p.body)
    drive = MultirotorDrive(p, body, state.memory, voltage)
    s, rotors, _, _ = evaluate(drive, tick * interval, seen(layout, state.motion))
    linear, angular = _accelerations(drive, tick * interval, state.motion)
    return MultirotorObservation(
        linear,
        angular,
        rotors.thrust,
        rotors.torque,
        rotors.acceleration,
        rotors.voltage,
        rotors.current,
        rotors.power,
        s.air.density,
        hooks.all_winds(p.effects, state.memory, s.air.wind_world),
        s.body.mass,
        hooks.all_contacts(p.effects, state.memory, s),
        hooks.all_gauges(p.effects, state.memory, (math.nan, layout.max_voltage, total(rotors.current), math.nan)),
    )


def parameters(airframe: "Airframe", effects: tuple = ()) -> MultirotorParameters:
    """The compiled plant's numbers for an airframe under effects (from `dynamics.effects.from_scene`)."""
    mass, rotors, engine = airframe.mass, airframe.rotors, airframe.motor
    x_body, y_body, z_body = zip(*rotors.position, strict=True)
    layout = RotorLayout(
        x_body, y_body, z_body, rotors.reaction_sign, rotors.inertia,
        engine.rotor_constant, 1.0 / engine.rotor_constant, 1.0 / engine.time_constant,
        engine.max_voltage, engine.no_load_current, axis=rotors.tilted_axis,
    )  # fmt: skip
    if airframe.payload:  # of the class of the mass properties once it is released, which has more numbers
        body: AnyMassProperties = offset_body(mass.total, mass.matrix, np.zeros(3))
    else:
        body = body_of(mass.total, mass.inertia, mass.products)
    return MultirotorParameters(body, layout, effects, CONTACT_TOLERANCE)


def initial_state(
    p: MultirotorParameters,
    position_world: Vec3 = (0.0, 0.0, 0.0),
    attitude: Quaternion = NO_ROTATION,
    rotor_speed: float = 0.0,
    velocity_world: Vec3 = ZERO,
    omega_body: Vec3 = ZERO,
) -> MultirotorState:
    """All rotors at the same speed [rad/s], the effects' memory fresh; without more at rest in the world."""
    motion = Motion(position_world, attitude, velocity_world, omega_body, (rotor_speed,) * len(p.layout.x_body))
    return MultirotorState(motion, tuple(hooks.initial_memory(e) for e in p.effects))
