"""Equations of motion of a multirotor under the effects of its scene.

This module has only kinematics, Newton's and Euler's equations and the lag of the rotors (theory, chapter 1);
every force is an effect (lapwing/dynamics/effects). All functions are pure. The representation of the motion in the
state is a formulation (`FORMULATIONS`): here one rigid body; other modules add more with the same effects and steps.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

from lapwing.dynamics.effects import _hooks as hooks
from lapwing.dynamics.effects._axes import thrust_wrench
from lapwing.dynamics.effects._rotor_sums import total
from lapwing.dynamics.effects._types import (
    Air,
    AnyMassProperties,
    EffectInputs,
    Factors,
    Loads,
    Motion,
    PerRotor,
    Rotors,
)
from lapwing.dynamics.integrators import CompensatedSummation
from lapwing.dynamics.lie.quaternion import rotation_matrix
from lapwing.dynamics.vector import ZERO, Vec3, product
from lapwing.dynamics.vehicles.newton_euler import newton_euler
from lapwing.kernels import DispatchTable, always_inline, noinline
from lapwing.kernels.codegen import dispatch, generic, map_tuple, reduce_tuple

PLAIN_TOLERANCE = 1e-13  # below it, the error of plain sums of the parts of a step can exceed the accuracy
ROUNDING, MOST_ROUNDS = 1e-14, 16  # relative to the battery's voltage; of the iteration for it
STANDARD_DENSITY = 1.225  # [kg/m^3] default without an effect: 15 degC, 1 atm


class RotorLayout(NamedTuple):
    """Rotors and motors, as far as the plant without effects needs them."""

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
    bodies: Any = ()  # data of formulations with several bodies
    axis: tuple[Vec3, ...] = ()  # unit vector of each rotor's thrust in the body; () if it is body z


class MultirotorParameters(NamedTuple):
    """Parameters of a vehicle in a scene."""

    body: AnyMassProperties
    layout: RotorLayout
    effects: tuple  # parameter NamedTuples of the active effects, sorted by name
    tolerance: float  # error of a substep while the vehicle is in contact, relative to 1 + size
    summation: tuple = ()  # CompensatedSummation() to compensate the sums of these substeps; see `with_tolerance`


def with_tolerance(p: MultirotorParameters, tolerance: float) -> MultirotorParameters:
    """Return parameters with another tolerance of substeps in contact, and the summation that it requires."""
    return p._replace(tolerance=tolerance, summation=() if tolerance >= PLAIN_TOLERANCE else CompensatedSummation())


class MultirotorState(NamedTuple):
    """Plant state from one communication step to the next."""

    motion: Any  # an instance of a class in FORMULATIONS: Motion, or several bodies
    memory: tuple  # memory of each effect


@always_inline
def _never(layout, x, h):
    return False


class Formulation(NamedTuple):
    """Compiled functions of a class that represents the motion in the state."""

    motion: Callable  # (layout, x) -> Motion that effects read
    rate: Callable  # (u, t, x) -> tangent of x
    project: Callable  # (u, x) -> x after a step, projected onto its constraints
    accelerations: Callable  # (u, t, x) -> (linear [m/s^2] in the world, angular [rad/s^2] in the body)
    switches: Callable = _never  # (layout, x, h) -> True if a force of the formulation can begin or end within h [s]


FORMULATIONS = DispatchTable()
motion_of = dispatch(FORMULATIONS, 1, "motion")
accelerations_of_state = dispatch(FORMULATIONS, 2, "accelerations")


class StepInputs(NamedTuple):
    """Inputs of the rate of change that are constant over a step."""

    parameters: MultirotorParameters
    body: AnyMassProperties
    memory: tuple
    voltage: PerRotor  # [V]


@always_inline
def _lag(s, speed, voltage):
    return s.layout.lag_rate * (s.layout.speed_per_volt * voltage - speed)


@always_inline
def _static_current(s, torque, voltage):
    """Return the current that balances the aerodynamic torque (theory, eq. (1.14)); 0 with the controller off."""
    return torque / s.layout.volt_per_speed + s.layout.no_load_current if voltage > 0.0 else 0.0


@always_inline
def _motors(u, s, loads, voltage):
    """Return (acceleration [rad/s^2], current [A], power [W]) of each rotor under its voltage [V]."""
    current = map_tuple(_static_current, s, loads.torque, voltage)
    lag = (map_tuple(_lag, s, s.motion.rotor_speed, voltage), current, map_tuple(product, 0.0, voltage, current))
    return hooks.all_motors(u.parameters.effects, u.memory, s, loads, voltage, lag)


@always_inline
def _at_most(limit, voltage, _):
    return min(voltage, limit)


@always_inline
def _higher(_, highest, voltage, __):
    return max(highest, voltage)


@always_inline
def _excess(u, s, loads, voltage):
    """Return by how much [V] the battery's voltage under the motors' power at a supply of `voltage` is above it."""
    power = total(_motors(u, s, loads, map_tuple(_at_most, voltage, u.voltage, u.voltage))[2])
    return hooks.battery_voltage(u.parameters.effects, u.memory, power) - voltage


@noinline
def _limited_voltage(u, s, loads, a):
    """Return the battery's voltage [V] under the power of motors that it limits; `a`: its voltage without load [V].

    The power grows with the voltage, so the root lies between the voltages without load and under the power for it.
    """
    at_a = _excess(u, s, loads, a)
    b, rounding = a + at_a, ROUNDING * a
    at_b = _excess(u, s, loads, b)
    for _ in range(MOST_ROUNDS):
        if abs(at_b) <= rounding:
            break
        c = b - at_b * ((b - a) / (at_b - at_a))
        at_c = _excess(u, s, loads, c)
        if at_c * at_b < 0.0:
            a, at_a = b, at_b
        else:  # the rule of false position converges from both sides with half the value at the other end (Illinois)
            at_a *= 0.5
        b, at_b = c, at_c
    return b


@always_inline
def _limited_by_battery(u, s, loads):
    """Return the voltages [V] of the motors, none above that of the battery under their power (theory, eq. (2.10))."""
    highest = reduce_tuple(_higher, None, 0.0, u.voltage, u.voltage)
    if _excess(u, s, loads, highest) >= 0.0:
        return u.voltage
    limit = _limited_voltage(u, s, loads, hooks.battery_voltage(u.parameters.effects, u.memory, 0.0))
    return map_tuple(_at_most, limit, u.voltage, u.voltage)


@always_inline
def _commanded(u, s, loads):
    return u.voltage


@generic(inline=True)
def _supplied(effects, u, s, loads):
    """Return the voltage [V] of each motor."""
    supplied = _limited_by_battery if has_battery(effects) else _commanded
    return lambda effects, u, s, loads: supplied(u, s, loads)


def has_battery(effects: Any) -> bool:
    """Return True if an effect limits the motors' voltages, by the type of the tuple of effects."""
    return any(e.instance_class in hooks.HOOKS["battery"] for e in effects.types)


@always_inline
def _constant(c, a, b):
    return c


@always_inline
def inputs(u, t, motion):
    """Return the EffectInputs of a motion."""
    p, memory, body = u.parameters, u.memory, u.body
    R_world_body = rotation_matrix(motion.attitude)
    still = Air(STANDARD_DENSITY, (0.0, 0.0, 0.0))
    s = EffectInputs(t, motion, R_world_body, body, p.layout, still, ZERO)
    air_rate_body = hooks.all_air_rate(p.effects, memory, s, ZERO)
    air = hooks.all_air(p.effects, memory, s, still)
    return EffectInputs(t, motion, R_world_body, body, p.layout, air, air_rate_body)


@always_inline
def evaluate(u, t, motion):
    """Evaluate all effects. Return (inputs, rotors, force_world [N], torque_body [N m])."""
    p, memory = u.parameters, u.memory
    layout, speed = p.layout, motion.rotor_speed
    s = inputs(u, t, motion)
    # -0.0 is neutral in addition, so the compiler removes it
    one, zero = map_tuple(_constant, 1.0, speed, speed), map_tuple(_constant, -0.0, speed, speed)
    factors = hooks.all_load_factors(p.effects, memory, s, Factors(one, one))
    loads = hooks.all_loads(p.effects, memory, s, factors, Loads(zero, zero))
    voltage = _supplied(p.effects, u, s, loads)
    acceleration, current, power = _motors(u, s, loads, voltage)
    rotors = Rotors(loads.thrust, loads.torque, acceleration, current, voltage, power)
    thrust, torque = thrust_wrench(layout, loads)
    torque = hooks.all_torques(p.effects, memory, s, rotors, torque)
    force, torque = hooks.all_body_wrenches(p.effects, memory, s, rotors, thrust, torque)
    force, torque = hooks.all_wrenches(p.effects, memory, s, rotors, force, torque)
    return s, rotors, force, torque


@always_inline
def rate(u, t, motion):
    """Return the tangent of the motion: Newton's and Euler's equations (theory, eq. (1.3) to (1.6))."""
    s, rotors, force, torque = evaluate(u, t, motion)
    linear, angular = newton_euler(s.body, u, s, force, torque)
    return Motion(motion.velocity_world, motion.omega_body, linear, angular, rotors.acceleration)


@always_inline
def _itself(_, motion):
    return motion


@always_inline
def accelerations(u, t, motion):
    """Return (linear [m/s^2] in the world, angular [rad/s^2] in the body)."""
    s, _, force, torque = evaluate(u, t, motion)
    return newton_euler(s.body, u, s, force, torque)


FORMULATIONS[Motion] = Formulation(_itself, rate, _itself, accelerations)
