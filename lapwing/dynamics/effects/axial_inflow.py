"""Effect of axial air speed on thrust and torque of the rotors."""

from typing import NamedTuple

from lapwing.dynamics.effects._axes import axial_speeds
from lapwing.dynamics.effects._from_scene import Airframe, reject, validate_table
from lapwing.dynamics.effects._hooks import loads, switches
from lapwing.dynamics.effects._types import Loads
from lapwing.dynamics.vector import pair, product
from lapwing.dynamics.vehicles.propeller import drag_coefficients, thrust_constant, torque_coefficient
from lapwing.kernels import always_inline, math
from lapwing.kernels.codegen import map_tuple, reduce_tuple

KIND = "flow through the rotors"
LIMIT = 0.5  # of the rotor's speed, to which the axial speed counts
SUDDEN = 100.0  # [m/s^2] no hub accelerates faster through the air


class Settings(NamedTuple):
    """No keys: the parameters are in the airframe's [propeller]."""


class AxialInflow(NamedTuple):
    """Change of the static loads of `rotor_thrust` in climb and descent (theory, eq. (2.5)).

    The angle of attack decreases with the axial advance per revolution: T = T_0 (1 - w / speed), and the induced torque
    with the square. w = 2 pi V / pitch uses the axial speed V of each hub, which damps roll and pitch. Source: the
    paper's blade section with small pitch and inflow angles. Valid for |w| below
    half the rotor speed, to which it is clamped, outside the vortex ring state.
    """

    thrust_constant: float  # [m^4/rad^2]
    induced_torque_constant: float  # [m^5/rad^2]
    turn_per_metre: float  # [rad/m] 2 pi over pitch

    @classmethod
    def from_scene(cls, table: dict, airframe: Airframe) -> "AxialInflow":
        """Return the parameters of the airframe's propeller."""
        validate_table(Settings, table)
        propeller = airframe.propeller or reject("the vehicle has no [propeller]")
        if propeller.zero_lift_angle != 0.0:
            reject("needs a propeller with zero_lift_angle = 0, for which it is derived")
        profile, induced = drag_coefficients(propeller)
        square = math.square(2.0 * math.pi)
        return cls(
            thrust_constant(propeller),
            torque_coefficient(propeller) * induced / (profile + induced) * math.pow(propeller.diameter, 5) / square,
            2.0 * math.pi / propeller.pitch,
        )


@always_inline
def _advance(turn_per_metre, axial, speed):
    """Return the axial speed of a hub in turns over the pitch [rad/s], clamped to the valid range."""
    return min(max(turn_per_metre * axial, -LIMIT * speed), LIMIT * speed)


@always_inline
def _square_change(_, speed, w):
    return w * (speed + speed - w)


@always_inline
def _less(constant, before, both):
    return before - (constant * both[1]) * both[0]


@loads(AxialInflow)
def axial_inflow(e, memory, s, factors, before):
    """Add the loads of each rotor to `before`."""
    speed, density = s.motion.rotor_speed, s.air.density
    w = map_tuple(_advance, e.turn_per_metre, axial_speeds(s), speed)
    linear, square = map_tuple(product, 0.0, speed, w), map_tuple(_square_change, 0.0, speed, w)
    return Loads(
        map_tuple(_less, e.thrust_constant * density, before.thrust, map_tuple(pair, 0.0, linear, factors.thrust)),
        map_tuple(
            _less, e.induced_torque_constant * density, before.torque, map_tuple(pair, 0.0, square, factors.torque)
        ),
    )


@always_inline
def fastest_spin(layout, speed):
    """Return the largest acceleration of a rotor by its lag [rad/s^2]."""
    return layout.lag_rate * max(speed, layout.speed_per_volt * layout.max_voltage - speed)


@always_inline
def _reaches(c, reached, axial, speed):
    turn_per_metre, layout, h = c
    off = abs(turn_per_metre * abs(axial) - LIMIT * speed)
    return reached or off <= h * (turn_per_metre * SUDDEN + LIMIT * fastest_spin(layout, speed))


@switches(AxialInflow)
def reaches_limit(e, memory, s, voltage, h):
    """Return True unless the axial speed of every hub stays within its limit, or beyond it."""
    return reduce_tuple(_reaches, (e.turn_per_metre, s.layout, h), False, axial_speeds(s), s.motion.rotor_speed)
