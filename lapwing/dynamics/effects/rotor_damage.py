"""Propeller damage or loss in flight."""

from typing import Annotated, NamedTuple

from annotated_types import Ge, Gt, Le

from lapwing.dynamics.config_error import ConfigError
from lapwing.dynamics.effects._from_scene import Airframe, validate_table
from lapwing.dynamics.effects._hooks import break_time, load_factors, timed_update
from lapwing.dynamics.effects._types import Factors, PerRotor
from lapwing.dynamics.vector import product
from lapwing.kernels.codegen import map_tuple


class Settings(NamedTuple):
    """Scene table."""

    rotor: Annotated[int, Gt(0)]  # number of the rotor, from 1
    time: Annotated[float, Ge(0)] = 0.0  # [s] simulation time
    remaining_thrust: Annotated[float, Ge(0), Le(1)] = 0.0  # fraction
    remaining_torque: Annotated[float, Ge(0), Le(2)] = 0.0  # fraction; a torn blade may drag more


class RotorDamage(NamedTuple):
    """Reduction of thrust and torque of one rotor from a given time on (theory, eq. (2.27)).

    Source: the definition. Valid for the mean loads of a torn or lost blade, without imbalance and vibration; the
    motor continues to turn.
    """

    time: float  # [s]
    remaining_thrust: tuple[float, ...]  # fraction of each rotor
    remaining_torque: tuple[float, ...]

    @classmethod
    def from_scene(cls, table: dict, airframe: Airframe) -> "RotorDamage":
        """Return the parameters for one of the airframe's rotors."""
        settings = validate_table(Settings, table)
        count = len(airframe.rotors.position)
        if settings.rotor > count:
            raise ConfigError("rotor", f"got {settings.rotor}", f"one of the vehicle's rotors, 1 to {count}")

        def only_this(left):
            return tuple(left if k == settings.rotor else 1.0 for k in range(1, count + 1))

        return cls(settings.time, only_this(settings.remaining_thrust), only_this(settings.remaining_torque))

    def initial_discrete_state(self) -> tuple[PerRotor, PerRotor]:
        """Return the current fractions of thrust and torque."""
        return (1.0,) * len(self.remaining_thrust), (1.0,) * len(self.remaining_torque)


@break_time(RotorDamage)
def moment(e, memory, t, h, value):
    """Return the moment of the damage if it is to come."""
    return min(value, e.time) if t < e.time else value


@timed_update(RotorDamage)
def strike(e, memory, t):
    """Return the fractions from a time on."""
    return (e.remaining_thrust, e.remaining_torque) if t >= e.time else memory


@load_factors(RotorDamage)
def rotor_damage(e, memory, s, before):
    """Multiply the damaged rotor's load factors."""
    return Factors(map_tuple(product, 0.0, before.thrust, memory[0]), map_tuple(product, 0.0, before.torque, memory[1]))
