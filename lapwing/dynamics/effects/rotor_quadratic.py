"""Static thrust and torque of the rotors from two given constants."""

from typing import Annotated, NamedTuple

from annotated_types import Gt, Le

from lapwing.dynamics.effects._hooks import loads
from lapwing.dynamics.effects._types import Loads
from lapwing.dynamics.vector import pair
from lapwing.kernels import always_inline
from lapwing.kernels.codegen import map_tuple

KIND = "rotor thrust model"


class RotorQuadratic(NamedTuple):
    """Thrust b w^2 and torque d w^2 of every rotor, independent of the air density (theory, eq. (2.4)).

    Source: the usual model of the quadrotor literature, e.g. Bouabdallah, thesis EPFL 3727 (2007). Valid near hover, at
    the altitude at which the constants were measured.
    """

    thrust_constant: Annotated[float, Gt(0), Le(1)]  # [N s^2/rad^2] thrust over the squared rotor speed
    torque_constant: Annotated[float, Gt(0), Le(1)]  # [N m s^2/rad^2] torque over the squared rotor speed


@always_inline
def _add_quadratic(constant, speed, both):
    return both[0] + constant * (speed * speed) * both[1]


@loads(RotorQuadratic)
def rotor_quadratic(e, memory, s, factors, before):
    """Add the loads of each rotor to `before`."""
    speed = s.motion.rotor_speed
    return Loads(
        map_tuple(_add_quadratic, e.thrust_constant, speed, map_tuple(pair, 0.0, before.thrust, factors.thrust)),
        map_tuple(_add_quadratic, e.torque_constant, speed, map_tuple(pair, 0.0, before.torque, factors.torque)),
    )
