"""Direct-current motors with an electrical model, instead of a first-order lag of the rotor speed."""

import math
from typing import Annotated, NamedTuple

from annotated_types import Ge, Le

from lapwing.dynamics.effects._axes import by_axis
from lapwing.dynamics.effects._external_motor import FULL_FRICTION, DcMotorInputs, ExternalDcMotor, idle_current
from lapwing.dynamics.effects._from_scene import Airframe, validate_table
from lapwing.dynamics.effects._hooks import discrete_update, motor, switches
from lapwing.dynamics.effects._motor_winding import NONE, decays_within, transient_currents, winding_constants
from lapwing.dynamics.vector import first, pair, second
from lapwing.kernels import always_inline
from lapwing.kernels.codegen import map_tuple, reduce_tuple

KIND = "motor model"
OPTIONS = {"braking_current": 10.0, "inductance": 1e-5}  # typical values of a small motor, for `lapwing effects`


class Settings(NamedTuple):
    """Scene table; the rest is in the airframe's [motor] and [rotors]."""

    braking_current: Annotated[float, Ge(0), Le(1e4)] = 0.0  # [A] limit of the braking current; 0: no braking
    inductance: Annotated[float, Ge(0), Le(1)] = 0.0  # [H] of the winding, between two leads


class DcMotor(NamedTuple):
    """Direct-current motor behind a belt: J w' = e K (I - I_0) - M, I = (V - K w) / R (theory, eq. (2.9), (2.76)).

    The resistance includes motor and controller, the inertia the rotor and, through the belt, the motor. The lower
    limit of the current is minus the braking current of the controller. The upper limit is the lowest of the
    controller's limit, the motor's peak current, the motor's share of the battery's C rating, and the current at the
    motor's peak power. At a limit the controller reduces the voltage; it draws that power divided by its efficiency,
    and returns power while it brakes. Source: the usual steady model of a brushless motor with speed constant,
    resistance and idle current; with an inductance L I' = V - K w - R I, solved exactly for constant voltage and
    torque. Valid for changes slower than about 1 ms.
    """

    motor_constant: float  # [N m/A] = [V s/rad] K at the rotor, after the belt
    inverse_resistance: float  # [1/ohm]
    no_load_current: float  # [A]
    least_current: float  # [A] not positive: minus the braking current
    current_limit: float  # [A]
    power_limit: float  # [W] taken by the motor
    inverse_inertia: float  # [1/(kg m^2)] of one rotor and its motor
    efficiency: float  # of the belt
    inverse_esc_efficiency: float
    winding: tuple = ()  # (lag [A s^2/rad], effective inverse inertia [1/(kg m^2)], rate [1/s]) of a winding that lags
    rotors: int = 0  # of the vehicle

    @classmethod
    def from_scene(cls, table: dict, airframe: Airframe) -> "DcMotor":
        """Return the parameters of the airframe's motor."""
        settings = validate_table(Settings, table)
        engine = airframe.motor
        inertia = airframe.rotors.inertia + engine.inertia / (engine.gear_ratio * engine.gear_ratio)
        resistance = engine.resistance + engine.esc_resistance
        winding = ()
        if settings.inductance:
            winding = winding_constants(
                settings.inductance, resistance, engine.rotor_constant, engine.belt_efficiency, inertia
            )
        return cls(
            engine.rotor_constant,
            1.0 / resistance,
            engine.no_load_current,
            0.0 - settings.braking_current,
            airframe.motor_current_limit,
            engine.power_limit,
            1.0 / inertia,
            engine.belt_efficiency,
            1.0 / engine.esc_efficiency,
            winding,
            len(airframe.rotors.position),
        )

    def initial_discrete_state(self) -> tuple:
        """Return () without inductance; else the time [s] and, of each rotor, (transient current [A], voltage [V])."""
        return (0.0, ((0.0, 0.0),) * self.rotors) if self.winding else ()

    def with_inputs(self) -> "ExternalDcMotor":
        """Return the motors with named inputs."""
        unknown = (math.nan,) * self.rotors
        return ExternalDcMotor(self, DcMotorInputs(unknown, unknown, unknown))


@always_inline
def _free(e, speed, voltage):
    """Return the current [A] without limits and inductance."""
    return voltage * e.inverse_resistance - (e.motor_constant * e.inverse_resistance) * speed


@always_inline
def _limit_current(e, speed, current):
    """Return the current [A] that the controller allows."""
    desired = min(max(current, e.least_current), e.current_limit)
    # the power K w I + R I^2 is at its limit where I = 2 P / (K w + sqrt((K w)^2 + 4 R P))
    back = e.motor_constant * speed
    if desired * (back + desired / e.inverse_resistance) <= e.power_limit:
        return desired
    return 2.0 * e.power_limit / (back + math.sqrt(back * back + 4.0 * e.power_limit / e.inverse_resistance))


@always_inline
def _acceleration(e, inverse_inertia, speed, current, torque):
    friction = idle_current(e, speed)
    return (e.efficiency * e.motor_constant * inverse_inertia) * (current - friction) - torque * inverse_inertia


@always_inline
def _power(e, speed, free, current, voltage):
    """Return the power [W] at the controller, for the commanded voltage or another one within the current limits."""
    if current != free:
        voltage = e.motor_constant * speed + current / e.inverse_resistance
    electrical = voltage * current
    return electrical * e.inverse_esc_efficiency if current >= 0.0 else electrical / e.inverse_esc_efficiency


@always_inline
def _no_lag(_):
    return NONE


@always_inline
def _lag(arguments):
    e, speed, torque, current = arguments
    lag, inverse_inertia, _ = e.winding
    return lag * _acceleration(e, inverse_inertia, speed, current, torque)


@always_inline
def _lag_current(e, speed, torque, current):
    """Return the current [A] by which a winding lags behind its motor's acceleration."""
    return by_axis(_no_lag, _lag, e.winding, (e, speed, torque, current))


@always_inline
def _steady_current(e, speed, torque, voltage):
    """Return the current [A] before limits once the transient of the winding is over."""
    free = _free(e, speed, voltage)
    return free + _lag_current(e, speed, torque, free)


@always_inline
def _rotor_response(e, both, more):
    """Return (acceleration [rad/s^2], current [A], power [W]) of a rotor."""
    speed, torque = both
    voltage, transient = more
    free = _steady_current(e, speed, torque, voltage) + transient
    current = _limit_current(e, speed, free)
    acceleration = _acceleration(e, e.inverse_inertia, speed, current, torque)
    return acceleration, current, _power(e, speed, free, current, voltage)


@always_inline
def _transient_after_step(e, both, more):
    """Return (transient [A], voltage [V]) of a rotor after a step of the voltage."""
    speed, torque = both
    voltage, (transient, (_, before)) = more
    current = _limit_current(e, speed, _steady_current(e, speed, torque, before) + transient)
    return current - _steady_current(e, speed, torque, voltage), voltage


@always_inline
def _update_without_lag(_):
    return ()


@always_inline
def _update_with_lag(arguments):
    e, memory, s, rotors = arguments
    both = map_tuple(pair, 0.0, s.motion.rotor_speed, rotors.torque)
    windings = map_tuple(pair, 0.0, transient_currents(e.winding, memory, s.t, rotors.voltage), memory[1])
    return s.t, map_tuple(_transient_after_step, e, both, map_tuple(pair, 0.0, rotors.voltage, windings))


@discrete_update(DcMotor)
def continue_current(e, memory, s, rotors, key, tick, interval):
    """Return the transient of each winding after the voltages have changed."""
    return by_axis(_update_without_lag, _update_with_lag, e.winding, (e, memory, s, rotors))


@always_inline
def _third(_, driven, __):
    return driven[2]


@motor(DcMotor)
def dc_motor(e, memory, s, loads, voltage):
    """Return (acceleration [rad/s^2], current [A], power [W]) of each rotor."""
    both = map_tuple(pair, 0.0, s.motion.rotor_speed, loads.torque)
    driven = map_tuple(
        _rotor_response, e, both, map_tuple(pair, 0.0, voltage, transient_currents(e.winding, memory, s.t, voltage))
    )
    return (
        map_tuple(first, 0.0, driven, driven),
        map_tuple(second, 0.0, driven, driven),
        map_tuple(_third, 0.0, driven, driven),
    )


@always_inline
def _near_limit(e, most, h, speed, free, slack):
    """Return True if a current before limits [A], known to `slack`, can reach a limit within h [s]; see `switches`."""
    # no rotor is braked by more than the largest torque of its motor
    spin = h * e.efficiency * e.motor_constant * e.inverse_inertia * (most - e.least_current)  # [rad/s]
    reach = slack + e.motor_constant * e.inverse_resistance * spin
    lacking = e.least_current - free  # at constant voltage a current that is above this limit does not reach it
    above = free - _limit_current(e, speed, math.inf)
    corner = e.power_limit / e.current_limit - e.current_limit / e.inverse_resistance - e.motor_constant * speed
    return (
        -slack <= lacking <= reach
        or abs(above) <= 1.5 * reach  # the limit of the power moves by up to half
        or abs(corner) <= e.motor_constant * spin
        or abs(speed - FULL_FRICTION) <= spin
    )


@always_inline
def _reaches(c, reached, both, transient):
    e, layout, h = c
    speed, voltage = both
    most, free = min(e.current_limit, layout.max_voltage * e.inverse_resistance), _free(e, speed, voltage)
    slack = _lag_current(e, 0.0, 0.0, abs(free) + most) + abs(transient)
    return reached or _near_limit(e, most, h, speed, free, slack)


@switches(DcMotor)
def needs_error_control(e, memory, s, voltage, h):
    """Return True unless every current stays within its limits, or beyond one of them, without a fast transient.

    At constant voltage V a current before limits, (V - K w) / R, changes with the speed only.
    """
    speed = s.motion.rotor_speed
    transients = transient_currents(e.winding, memory, s.t, voltage)
    fast = decays_within(e.winding, h)
    return reduce_tuple(_reaches, (e, s.layout, h), fast, map_tuple(pair, 0.0, speed, voltage), transients)
