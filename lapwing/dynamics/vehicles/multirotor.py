"""Multirotor plant: one rigid body with rotors, driven by motor voltages, under the effects of its scene.

All functions are pure. The equations are in `multirotor_equations`, their steps in `multirotor_stepper`;
`multirotor_multibody` has five bodies in place of one, with the same effects, `advance` and `observe`.
"""

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from lapwing.dynamics.effects import _hooks as hooks
from lapwing.dynamics.effects._rotor_sums import total
from lapwing.dynamics.effects._types import AnyMassProperties, Motion, PerRotor, body_of, offset_body
from lapwing.dynamics.lie.quaternion import NO_ROTATION, Quaternion
from lapwing.dynamics.vector import ZERO, Vec3
from lapwing.dynamics.vehicles.multirotor_equations import (
    MultirotorParameters,
    MultirotorState,
    RotorLayout,
    StepInputs,
    accelerations_of_state,
    evaluate,
    motion_of,
)
from lapwing.dynamics.vehicles.multirotor_stepper import begin, steps, with_known_wrenches, within
from lapwing.dynamics.vehicles.step_bound import parts
from lapwing.kernels import kernel
from lapwing.kernels.codegen import map_tuple

if TYPE_CHECKING:  # services do not import pydantic
    from lapwing.dynamics.vehicles.airframe import Airframe

CONTACT_TOLERANCE = 1e-6  # default error of a substep in contact


class MultirotorObservation(NamedTuple):
    """Quantities derived from a state."""

    acceleration_world: Vec3  # [m/s^2] acceleration of the motion's position
    angular_acceleration_body: Vec3  # [rad/s^2]
    thrust: PerRotor  # [N]
    torque: PerRotor  # [N m] aerodynamic torque against each rotor
    rotor_acceleration: PerRotor  # [rad/s^2]
    motor_voltage: PerRotor  # [V]
    motor_current: PerRotor  # [A]
    motor_power: PerRotor  # [W] power of each motor and its controller
    air_density: float  # [kg/m^3]
    wind_world: Vec3  # [m/s] wind, including winds that act as forces only
    mass: float  # [kg]
    in_contact: bool
    battery: tuple[float, float, float, float]  # charge, voltage [V], current [A], temperature [K]; NaN: not modelled


@kernel
def advance(method, p, key, tick, state, command, h, n):
    """Return the state a communication step later: n steps of length h [s] under constant voltages.

    Steps are split if a damping or the rotation is too fast for them (`step_bound`).

    Args:
        method: `Method()` of an integrator's module.
        p: MultirotorParameters.
        key: key of the vehicle's random numbers (lapwing/dynamics/noise.py); effects draw at `tick`.
        tick: index of the communication step; it starts at tick n h seconds.
        state: MultirotorState.
        command: voltage [V] of each motor, clamped to 0..maximum.
        h: step [s].
        n: steps in the communication step.
    """
    interval = n * h
    start = tick * interval
    u = begin(p, key, tick, state, command, interval)
    split = parts(p, motion_of(p.layout, state.motion), u.memory, h)
    x, memory = steps(method, u, state.motion, start, start + interval, h / split, 0, n * split)
    return MultirotorState(x, memory)


@kernel
def observe(p, tick, interval, state, command):
    """Return the MultirotorObservation of a state at `tick`, under the voltages `command` [V]."""
    layout = p.layout
    voltage = map_tuple(within, layout.max_voltage, command, command)
    body = hooks.all_mass_properties(p.effects, state.memory, p.body)
    motion = motion_of(layout, state.motion)
    # what `_awake_rate` evaluates, which therefore is compiled once for both
    u, _ = with_known_wrenches(StepInputs(p, body, state.memory, voltage), motion)
    s, rotors, _, _ = evaluate(u, tick * interval, motion)
    linear, angular = accelerations_of_state(u, tick * interval, state.motion)
    # without a battery, a source of constant voltage delivers the power of the motors
    source = (math.nan, layout.max_voltage, total(rotors.power) / layout.max_voltage, math.nan)
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
        hooks.battery_state(p.effects, state.memory, total(rotors.power), source),
    )


def parameters(airframe: "Airframe", effects: tuple = ()) -> MultirotorParameters:
    """Return the plant's parameters for an airframe with effects (from `lapwing.dynamics.effects.from_scene`)."""
    mass, rotors, engine = airframe.mass, airframe.rotors, airframe.motor
    x_body, y_body, z_body = zip(*rotors.position, strict=True)
    layout = RotorLayout(
        x_body, y_body, z_body, rotors.reaction_sign, rotors.inertia,
        engine.rotor_constant, 1.0 / engine.rotor_constant, 1.0 / engine.time_constant,
        engine.max_voltage, engine.no_load_current, axis=rotors.tilted_axis,
    )  # fmt: skip
    if airframe.payload:  # has the class of the mass properties after the release, which has more numbers
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
    """Return a state with all rotors at one speed [rad/s] and initial effects; by default at rest in the world."""
    motion = Motion(position_world, attitude, velocity_world, omega_body, (rotor_speed,) * len(p.layout.x_body))
    return MultirotorState(motion, tuple(hooks.initial_discrete_state(e) for e in p.effects))
