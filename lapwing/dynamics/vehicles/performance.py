"""Steady-flight performance of a multirotor, from the models that the plant integrates.

Steady level flight balances weight, drag of fuselage (theory, eq. (2.7)) and rotors (eq. (2.11)), and the thrust of
equal rotors with axial inflow (eq. (2.5)); the motors' voltage and current follow from the torque (theory, section
1.4). For tilted rotors the sum of their thrusts and their mean axial inflow count; for coaxial rotors the loss of the
lower ones (eq. (2.44)), with all rotors at one speed.
"""

import math
from typing import Literal, NamedTuple

from scipy.optimize import brentq, minimize_scalar

from lapwing.dynamics import atmosphere
from lapwing.dynamics.atmosphere import Atmosphere
from lapwing.dynamics.constants import STANDARD_GRAVITY
from lapwing.dynamics.effects.coaxial_interference import CoaxialInterference, has_rotor_in_wake
from lapwing.dynamics.environment import STANDARD
from lapwing.dynamics.vehicles.airframe import Airframe
from lapwing.dynamics.vehicles.airframe_tables import Motor
from lapwing.dynamics.vehicles.propeller import (
    drag_coefficients,
    h_force_coefficient,
    thrust_coefficient,
    torque_coefficient,
)

DENSITY = 1.225  # [kg/m^3]
CELL_VOLTAGE = 3.7  # [V] nominal
ITERATIONS = 100  # iterations of the rotor speed; each reduces the error by at least 10 %


class Trim(NamedTuple):
    """Steady level flight."""

    tilt: float  # [rad] from the vertical
    thrust: float  # [N] of a rotor outside of wakes
    rotor_speed: float  # [rad/s]
    voltage: float  # [V] of the fastest motor
    current: float  # [A] of the fastest motor
    power: float  # [W] of all motors


class Gain(NamedTuple):
    """Thrust and torque of a rotor in a wake relative to a free one at the same speed."""

    thrust: float  # [N]
    torque: float  # [N m]


class Rotor(NamedTuple):
    """Thrust and torque of a rotor over the square of its speed, and their dependence on axial inflow."""

    thrust: float  # [N s^2/rad^2] at a density of 1 kg/m^3, if it is proportional to the density
    torque: float  # [N m s^2/rad^2] at the same density
    with_density: bool = True
    pitch: float = math.inf  # [m] advance per turn without slip; inf: no effect of inflow
    parts: tuple[float, float] = (1.0, 0.0)  # shares of the torque: profile and induced
    drag: float = 0.0  # [m^3/rad] drag across the axis, over density, rotor speed and velocity
    wash: CoaxialInterference | None = None  # loss of rotors in the wake of others

    def constants(self, density: float) -> tuple[float, float]:
        """Return thrust and torque over the square of the speed at a density [kg/m^3]."""
        factor = density if self.with_density else 1.0
        return factor * self.thrust, factor * self.torque

    def gains(self, count: int, density: float, speed: float, axial: float = 0.0, across: float = 0.0) -> list[Gain]:
        """Return the gain of each of `count` rotors in a wake; see `CoaxialInterference.changes` for arguments."""
        changes = self.wash.changes(speed, axial, across) if self.wash else [(0.0, 0.0)] * count
        return [Gain(density * thrust, density * torque) for thrust, torque in changes]


def rotor_of(airframe: Airframe) -> Rotor:
    """Return the rotor of the airframe's propeller.

    Raises:
        ValueError: there is no propeller, or its model does not support rotors in the wake of others.
    """
    propeller, square = airframe.propeller, (2.0 * math.pi) ** 2
    if propeller is None:
        raise ValueError("the vehicle has no [propeller]; use a scene with [effects.rotor_quadratic]")
    return Rotor(
        thrust_coefficient(propeller) * propeller.diameter**4 / square,
        torque_coefficient(propeller) * propeller.diameter**5 / square,
        pitch=propeller.pitch,
        parts=drag_coefficients(propeller),
        drag=h_force_coefficient(propeller),
        wash=CoaxialInterference.from_scene({}, airframe) if has_rotor_in_wake(airframe) else None,
    )


def _lift(airframe: Airframe) -> float:
    """Return the force of all rotors over the thrust of one: their number, reduced by wakes."""
    axes = airframe.rotors.tilted_axis
    return math.hypot(*map(sum, zip(*axes, strict=True))) if axes else len(airframe.rotors.position)


def trim(
    airframe: Airframe,
    speed: float = 0.0,
    density: float = DENSITY,
    mass: float | None = None,
    rotor: Rotor | None = None,
) -> Trim:
    """Return steady level flight at a speed [m/s]; `mass` [kg] and `rotor` override the airframe's.

    Raises:
        ValueError: the airframe has no propeller, or no drag areas and a speed above 0.
    """
    rotor, count = rotor or rotor_of(airframe), len(airframe.rotors.position)
    if speed > 0.0 and airframe.drag is None:
        raise ValueError("the vehicle has no [drag]")
    weight = (airframe.mass.total if mass is None else mass) * STANDARD_GRAVITY
    ahead, _, below = airframe.drag.area if airframe.drag else (0.0, 0.0, 0.0)
    pressure = 0.5 * density * speed * speed

    k_thrust, k_torque = rotor.constants(density)
    lift = _lift(airframe)
    omega = math.sqrt(weight / (lift * k_thrust))
    for _ in range(ITERATIONS):  # the rotors' drag is proportional to their speed
        before, across = omega, pressure * ahead + count * density * rotor.drag * omega * speed

        def forces(tilt: float, across: float = across) -> tuple[float, float]:
            """Return the required thrust forward and up [N]."""
            c, s = math.cos(tilt), math.sin(tilt)
            return across * c * c + pressure * below * s * s, weight + (pressure * below - across) * s * c

        tilt = brentq(lambda a: math.sin(a) * forces(a)[1] - math.cos(a) * forces(a)[0], 0.0, 0.5 * math.pi)
        axial = speed * math.sin(tilt) * (lift / count)
        gains = rotor.gains(count, density, omega, axial, speed * math.cos(tilt))
        thrust = math.hypot(*forces(tilt)) / lift - sum(gain.thrust for gain in gains) / count
        w = 2.0 * math.pi * axial / rotor.pitch
        omega = 0.5 * (w + math.sqrt(w * w + 4.0 * thrust / k_thrust))
        if abs(omega - before) < 1e-12 * omega:
            break
    profile, induced = rotor.parts
    torque = k_torque * (profile * omega**2 + induced * (omega - w) ** 2) / (profile + induced)
    motor = airframe.motor
    electrics = [_electrics(motor, omega, torque + gain.torque) for gain in gains]
    power = sum(voltage * current for voltage, current in electrics) / motor.esc_efficiency
    return Trim(tilt, thrust, omega, *max(electrics), power)


def _electrics(motor: Motor, speed: float, torque: float) -> tuple[float, float]:
    """Return (voltage [V], current [A]) of a motor at a rotor speed [rad/s] and torque [N m]."""
    current = torque / (motor.belt_efficiency * motor.rotor_constant) + motor.no_load_current
    return motor.rotor_constant * speed + (motor.resistance + motor.esc_resistance) * current, current


def maximum_thrust(airframe: Airframe, density: float = DENSITY, rotor: Rotor | None = None) -> float:
    """Return the maximum thrust of all rotors in still air [N]; see `limited_thrust`."""
    return limited_thrust(airframe, density, rotor)[0]


def limited_thrust(
    airframe: Airframe, density: float = DENSITY, rotor: Rotor | None = None
) -> tuple[float, Literal["voltage", "current", "power"]]:
    """Return (maximum thrust of all rotors in still air [N], what limits it).

    Raises:
        ValueError: the current without load alone exceeds a limit.
    """
    rotor, motor, count = rotor or rotor_of(airframe), airframe.motor, len(airframe.rotors.position)
    gains = rotor.gains(count, density, 1.0)  # proportional to the square of the speed
    k_thrust, k_torque = rotor.constants(density)
    k_thrust += sum(gain.thrust for gain in gains) / count
    k_torque += max(gain.torque for gain in gains)

    def used(omega: float) -> dict[Literal["voltage", "current", "power"], float]:
        """Return voltage, current and power over their limits."""
        voltage, current = _electrics(motor, omega, k_torque * omega**2)
        return {
            "voltage": voltage / motor.max_voltage,
            "current": current / airframe.motor_current_limit,
            "power": voltage * current / motor.power_limit,
        }

    def excess(omega: float) -> float:
        return max(used(omega).values()) - 1.0

    if excess(0.0) > 0.0:
        voltage, current = _electrics(motor, 0.0, 0.0)
        limits = {airframe.motor_current_limit: "A", motor.max_voltage: "V", motor.power_limit: "W"}
        raise ValueError(
            f"a motor draws {current:.3g} A without load, with {voltage:.3g} V over its resistance; expected less than "
            + " and ".join(f"{limit:.3g} {unit}" for limit, unit in limits.items() if math.isfinite(limit))
        )
    highest = brentq(excess, 0.0, motor.max_voltage / motor.rotor_constant)
    shares = used(highest)
    return _lift(airframe) * k_thrust * highest**2, max(shares, key=shares.__getitem__)


def thrust_over_weight(airframe: Airframe, density: float = DENSITY, rotor: Rotor | None = None) -> float:
    """Return the maximum thrust over the weight of the loaded vehicle in still air, including resistive losses."""
    return maximum_thrust(airframe, density, rotor) / (airframe.mass.total * STANDARD_GRAVITY)


def battery_energy(airframe: Airframe) -> float:
    """Return the nominal energy [J] of the battery."""
    if airframe.battery is None:
        raise ValueError("the vehicle has no [battery]")
    return airframe.battery.cells * CELL_VOLTAGE * airframe.battery.capacity


def hover_time(airframe: Airframe, density: float = DENSITY, rotor: Rotor | None = None) -> float:
    """Return the hover time [s] at constant power."""
    return battery_energy(airframe) / trim(airframe, 0.0, density, rotor=rotor).power


def maximum_payload(airframe: Airframe, density: float = DENSITY, rotor: Rotor | None = None) -> float:
    """Return the mass [kg] that the maximum thrust lifts beyond the empty vehicle, without control margin."""
    return maximum_thrust(airframe, density, rotor) / STANDARD_GRAVITY - (airframe.mass.total - airframe.mass.payload)


def maximum_tilt(airframe: Airframe, density: float = DENSITY, rotor: Rotor | None = None) -> float:
    """Return the tilt [rad] at which the maximum thrust still balances the weight."""
    return math.acos(min(airframe.mass.total * STANDARD_GRAVITY / maximum_thrust(airframe, density, rotor), 1.0))


def ceiling(airframe: Airframe, air: Atmosphere = STANDARD.atmosphere, rotor: Rotor | None = None) -> float:
    """Return the altitude [m] at which the maximum thrust equals the weight (theory, eq. (2.3)).

    Raises:
        ValueError: the thrust does not depend on the density.
    """
    if rotor is not None and not rotor.with_density:
        raise ValueError("[effects.rotor_quadratic] has no air density")
    weight = airframe.mass.total * STANDARD_GRAVITY

    def excess(altitude: float) -> float:
        return maximum_thrust(airframe, atmosphere.density(air, altitude), rotor) - weight

    return brentq(excess, 0.0, 30_000.0) if excess(0.0) > 0.0 else 0.0


def maximum_speed(airframe: Airframe, density: float = DENSITY, rotor: Rotor | None = None) -> float:
    """Return the speed [m/s] in level flight at the maximum voltage."""
    highest = airframe.motor.max_voltage

    def excess(speed: float) -> float:
        return trim(airframe, speed, density, rotor=rotor).voltage - highest

    return brentq(excess, 0.0, 200.0) if excess(0.0) < 0.0 else 0.0


def maximum_range(airframe: Airframe, density: float = DENSITY, rotor: Rotor | None = None) -> tuple[float, float]:
    """Return (range [m], its speed [m/s]) in still air."""
    energy = battery_energy(airframe)
    best = minimize_scalar(
        lambda speed: -speed / trim(airframe, speed, density, rotor=rotor).power,
        bounds=(0.1, maximum_speed(airframe, density, rotor)),
        method="bounded",
    )
    return -best.fun * energy, best.x
