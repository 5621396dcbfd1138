"""Motors with a winding, instead of a rotor speed that follows the voltage with a lag."""

import math
from typing import TYPE_CHECKING, NamedTuple

from lapwing.dynamics.effects._from_scene import checked
from lapwing.dynamics.effects._hooks import motor
from lapwing.dynamics.vector import pair
from lapwing.kernels import always_inline
from lapwing.kernels.codegen import map_tuple

if TYPE_CHECKING:  # a process that flies has no need of pydantic
    from lapwing.dynamics.vehicles.airframe import Airframe

KIND = "motor model"
FULL_FRICTION = 1.0  # [rad/s] above which the idle current is drawn in full


class Settings(NamedTuple):
    """No keys: the airframe's [motor] and [rotors] say it all."""


class DcMotor(NamedTuple):
    """Direct-current motor behind a belt: J w' = e K (I - I_0) - M, I = (V - K w) / R (theory.md, eq. (2.9)).

    The resistance is that of motor and controller, the inertia that of the rotor and, through the belt, of the motor.
    The controller keeps the current between 0 (it does not brake) and the lowest of its own limit, the motor's peak
    current, its share of what the battery's C rating allows, and that at which the motor takes its peak power. Then it
    gives less voltage than it is asked for, and takes the power of that, over its efficiency. Source: the usual steady
    model of a brushless motor, from its speed constant, resistance and idle current; inductance neglected. Valid for
    changes slower than about 1 ms.
    """

    motor_constant: float  # [N m/A] = [V s/rad] K at the rotor, behind the belt
    inverse_resistance: float  # [1/ohm]
    no_load_current: float  # [A]
    current_limit: float  # [A]
    power_limit: float  # [W] taken by the motor
    inverse_inertia: float  # [1/(kg m^2)] of one rotor and its motor
    efficiency: float  # of the belt
    inverse_esc_efficiency: float

    @classmethod
    def from_scene(cls, table: dict, airframe: "Airframe") -> "DcMotor":
        """From the airframe's motor."""
        checked(Settings, table)
        engine = airframe.motor
        return cls(
            engine.rotor_constant,
            1.0 / (engine.resistance + engine.esc_resistance),
            engine.no_load_current,
            airframe.motor_current_limit,
            engine.power_limit,
            1.0 / (airframe.rotors.inertia + engine.inertia / (engine.gear_ratio * engine.gear_ratio)),
            engine.belt_efficiency,
            1.0 / engine.esc_efficiency,
        )


@always_inline
def _unlimited(e, speed, voltage):
    """Current [A] without the controller's limits, but that it does not brake."""
    return max(voltage * e.inverse_resistance - (e.motor_constant * e.inverse_resistance) * speed, 0.0)


@always_inline
def _current(e, speed, voltage):
    wanted = min(_unlimited(e, speed, voltage), e.current_limit)
    # the power K w I + R I^2 is at its limit where I = 2 P / (K w + sqrt((K w)^2 + 4 R P))
    back = e.motor_constant * speed
    if wanted * (back + wanted / e.inverse_resistance) <= e.power_limit:
        return wanted
    return 2.0 * e.power_limit / (back + math.sqrt(back * back + 4.0 * e.power_limit / e.inverse_resistance))


@always_inline
def _acceleration(e, torque, both):
    speed, current = both
    friction = e.no_load_current * min(speed * (1.0 / FULL_FRICTION), 1.0)
    return (e.efficiency * e.motor_constant * e.inverse_inertia) * (current - friction) - torque * e.inverse_inertia


@always_inline
def _power(e, voltage, both):
    """[W] at the controller: of the voltage asked for, or of the lower one that keeps the current in its limits."""
    speed, current = both
    if current < _unlimited(e, speed, voltage):
        voltage = e.motor_constant * speed + current / e.inverse_resistance
    return voltage * current * e.inverse_esc_efficiency


@motor(DcMotor)
def dc_motor(e, memory, s, loads, voltage):
    """(acceleration [rad/s^2], current [A], power [W]) of each rotor."""
    speed = s.motion.rotor_speed
    current = map_tuple(_current, e, speed, voltage)
    both = map_tuple(pair, 0.0, speed, current)
    return map_tuple(_acceleration, e, loads.torque, both), current, map_tuple(_power, e, voltage, both)
