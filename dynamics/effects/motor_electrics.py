"""Motors with a winding, instead of a rotor speed that follows the voltage with a lag."""

from typing import TYPE_CHECKING, NamedTuple

from dynamics.effects._hooks import motor
from dynamics.effects._scene import checked
from dynamics.generate import each
from dynamics.kernel import leaf

if TYPE_CHECKING:  # a process that flies has no need of pydantic
    from dynamics.vehicles.airframe import Airframe

KIND = "motor model"
FULL_FRICTION = 1.0  # [rad/s] above which the idle current is drawn in full


class Settings(NamedTuple):
    """No keys: the airframe's [motor] and [rotors] say it all."""


class MotorElectrics(NamedTuple):
    """Direct-current motor behind a belt: J w' = K (I - I_0) - M, I = (V - K w) / R (theory.md, eq. (2.9)).

    The current stays between 0 (the controller does not brake) and the controller's limit. Source: the usual steady
    model of a brushless motor, from its speed constant, resistance and idle current; inductance neglected. Valid
    for changes slower than about 1 ms.
    """

    motor_constant: float  # [N m/A] = [V s/rad] K at the rotor, behind the belt
    inverse_resistance: float  # [1/ohm]
    no_load_current: float  # [A]
    current_limit: float  # [A]
    inverse_inertia: float  # [1/(kg m^2)] of one rotor

    @classmethod
    def from_scene(cls, table: dict, airframe: "Airframe") -> "MotorElectrics":
        """From the airframe's motor."""
        checked(Settings, table)
        engine = airframe.motor
        return cls(
            engine.rotor_constant,
            1.0 / engine.resistance,
            engine.no_load_current,
            engine.esc_current,
            1.0 / airframe.rotors.inertia,
        )


@leaf
def _current(e, speed, voltage):
    short = voltage * e.inverse_resistance
    return min(max(short - (e.motor_constant * e.inverse_resistance) * speed, 0.0), e.current_limit)


@leaf
def _acceleration(e, torque, both):
    speed, current = both
    friction = e.no_load_current * min(speed * (1.0 / FULL_FRICTION), 1.0)
    return (e.motor_constant * e.inverse_inertia) * (current - friction) - torque * e.inverse_inertia


@leaf
def _pair(_, a, b):
    return a, b


@motor(MotorElectrics)
def motor_electrics(e, memory, s, loads, voltage):
    """(acceleration [rad/s^2], current [A]) of each rotor."""
    speed = s.motion.rotor_speed
    current = each(_current, e, speed, voltage)
    return each(_acceleration, e, loads.torque, each(_pair, 0.0, speed, current)), current
