"""Motors whose torque, speed or current comes from an external model."""

from typing import Any, NamedTuple

from lapwing.dynamics.effects import _hooks as hooks
from lapwing.dynamics.effects._external_inputs import all_given_or, external, initial_state
from lapwing.dynamics.effects._types import PerRotor
from lapwing.dynamics.vector import pair
from lapwing.kernels import always_inline
from lapwing.kernels.codegen import map_tuple

FULL_FRICTION = 1.0  # [rad/s] above which the idle current is drawn in full


class DcMotorInputs(NamedTuple):
    """Named inputs of the motors, one number for each rotor; NaN: the effect computes it."""

    torque: PerRotor  # [N m] of the motor on its rotor; friction is part of it, the torque of the air is not
    speed: PerRotor  # [rad/s] of the rotor, which it reaches at the end of the communication step
    current: PerRotor  # [A] of the winding


@external
class ExternalDcMotor(NamedTuple):
    """Motors with named inputs.

    A torque accelerates the rotor against that of the air. A speed takes precedence: the rotor reaches it at constant
    acceleration, one communication step after its sample. A current that only follows from the torque is that of the
    winding's torque constant.
    """

    own: Any  # DcMotor
    inputs: DcMotorInputs

    def initial_discrete_state(self) -> tuple:
        """Return (own discrete state, accelerations [rad/s^2] to the speeds of the inputs), and the inputs."""
        own, inputs = initial_state(self)
        return (own, inputs.speed), inputs


@always_inline
def _ramp(interval, speed, end):
    return (end - speed) / interval


@hooks.discrete_update(ExternalDcMotor)
def continue_external(e, memory, s, rotors, key, tick, interval):
    """Return the discrete state with the accelerations of a communication step."""
    (before, _), inputs = memory
    (own,) = hooks.all_discrete_updates((e.own,), (before,), s, rotors, key, tick, interval)
    return (own, map_tuple(_ramp, interval, s.motion.rotor_speed, inputs.speed)), inputs


@always_inline
def idle_current(e, speed):
    """Return the current [A] that friction takes at a speed [rad/s]."""
    return e.no_load_current * min(speed * (1.0 / FULL_FRICTION), 1.0)


@always_inline
def _acceleration(e, torque, air_torque):
    return (torque - air_torque) * e.inverse_inertia


@always_inline
def _current_of(e, torque, speed):
    return torque / (e.efficiency * e.motor_constant) + idle_current(e, speed)


@always_inline
def _power_of(e, both, former):
    """Return the power [W] of a winding's current; that of the effect if the current is the effect's own."""
    speed, current = both
    own_current, own_power = former
    if current == own_current:
        return own_power
    electrical = (e.motor_constant * speed + current / e.inverse_resistance) * current
    return electrical * e.inverse_esc_efficiency if current >= 0.0 else electrical / e.inverse_esc_efficiency


@hooks.switches(ExternalDcMotor)
def reaches_limit(e, memory, s, voltage, h):
    """Return True unless every current of the effect stays within its limits, or beyond one of them."""
    (own, _), _ = memory
    return hooks.all_switches((e.own,), (own,), s, voltage, h)


@hooks.motor(ExternalDcMotor)
def external_motor(e, memory, s, loads, voltage):
    """Return (acceleration [rad/s^2], current [A], power [W]) of each rotor."""
    (before, ramp), inputs = memory
    speed = s.motion.rotor_speed
    acceleration, own_current, power = hooks.all_motors((e.own,), (before,), s, loads, voltage, ())
    driven = map_tuple(_acceleration, e.own, inputs.torque, loads.torque)
    acceleration = all_given_or(all_given_or(acceleration, driven), ramp)
    current = all_given_or(own_current, map_tuple(_current_of, e.own, inputs.torque, speed))
    current = all_given_or(current, inputs.current)
    both, former = map_tuple(pair, 0.0, speed, current), map_tuple(pair, 0.0, own_current, power)
    return acceleration, current, map_tuple(_power_of, e.own, both, former)
