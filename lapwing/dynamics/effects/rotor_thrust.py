"""Static thrust and torque of the rotors from the propeller's geometry."""

from typing import NamedTuple

from lapwing.dynamics.effects._from_scene import Airframe, reject, validate_table
from lapwing.dynamics.effects._hooks import loads
from lapwing.dynamics.effects._types import Loads
from lapwing.dynamics.vehicles.propeller import thrust_constant, torque_constant
from lapwing.kernels import always_inline
from lapwing.kernels.codegen import map_tuple

KIND = "rotor thrust model"


class Settings(NamedTuple):
    """No keys: the parameters are in the airframe's [propeller]."""


class RotorThrust(NamedTuple):
    """Thrust and torque proportional to air density and speed squared (theory, eq. (2.28); (1.7) and (1.8)).

    Source: Pappalardo et al. 2023, section 2.6. Valid at rest and for advance ratios well below pitch over diameter;
    add `axial_inflow` beyond that.
    """

    thrust_constant: float  # [m^4/rad^2] C_T D^4 / (4 pi^2)
    torque_constant: float  # [m^5/rad^2] C_M D^5 / (4 pi^2)

    @classmethod
    def from_scene(cls, table: dict, airframe: Airframe) -> "RotorThrust":
        """Return the parameters of the airframe's propeller."""
        validate_table(Settings, table)
        propeller = airframe.propeller or reject("the vehicle has no [propeller]; use rotor_quadratic")
        return cls(thrust_constant(propeller), torque_constant(propeller))


@always_inline
def _times_square(constant, speed, factor):
    return (constant * factor) * (speed * speed)


@loads(RotorThrust)
def rotor_thrust(e, memory, s, factors, before):
    """Add the loads of each rotor to `before`."""
    speed, density = s.motion.rotor_speed, s.air.density
    return Loads(
        map_tuple(
            _sum, 0.0, before.thrust, map_tuple(_times_square, e.thrust_constant * density, speed, factors.thrust)
        ),
        map_tuple(
            _sum, 0.0, before.torque, map_tuple(_times_square, e.torque_constant * density, speed, factors.torque)
        ),
    )


@always_inline
def _sum(_, a, b):
    return a + b
