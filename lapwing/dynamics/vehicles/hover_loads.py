"""Loads in hover: power, currents, throttle, and the margins of speed controllers and battery."""

import math
from itertools import combinations

from lapwing.dynamics.vector import norm, subtract
from lapwing.dynamics.vehicles.airframe import Airframe
from lapwing.dynamics.vehicles.performance import CELL_VOLTAGE, DENSITY, Rotor, trim


def power(airframe: Airframe, density: float = DENSITY, rotor: Rotor | None = None) -> float:
    """Return the power [W] that the motors draw from the battery in hover."""
    return trim(airframe, 0.0, density, rotor=rotor).power


def power_fault(airframe: Airframe, rotor: Rotor, density: float = DENSITY) -> str:
    """Return a description if the rotors need less shaft power in hover than ideal ones; "" otherwise.

    An ideal rotor needs the power T^(3/2) / sqrt(2 rho A) of momentum theory. Without a propeller, the largest disk up
    to the nearest other hub is assumed, so the true limit is higher.
    """
    hover, (_, k_torque) = trim(airframe, 0.0, density, rotor=rotor), rotor.constants(density)
    hubs = [(x, y, 0.0) for x, y, _ in airframe.rotors.position]
    apart = [distance for a, b in combinations(hubs, 2) if (distance := norm(subtract(a, b))) > 0.0]
    radius = 0.5 * airframe.propeller.diameter if airframe.propeller else min(apart, default=math.inf)
    ideal = hover.thrust * math.sqrt(hover.thrust) / (radius * math.sqrt(2.0 * math.pi * density))
    shaft = k_torque * hover.rotor_speed * hover.rotor_speed * hover.rotor_speed
    if shaft >= ideal:
        return ""
    return f"the torque constant is too small: a rotor takes {shaft:.2g} W in hover, an ideal one {ideal:.2g} W"


def current(airframe: Airframe, density: float = DENSITY, rotor: Rotor | None = None) -> float:
    """Return the current [A] of the battery in hover, at nominal cell voltage less the drop over its resistance."""
    return battery_current(airframe, power(airframe, density, rotor))


def battery_current(airframe: Airframe, watts: float) -> float:
    """Return the current [A] at which the battery at nominal charge delivers the power `watts` [W].

    Raises:
        ValueError: there is no battery, or its resistance does not permit that power.
    """
    if (battery := airframe.battery) is None:
        raise ValueError("the vehicle has no [battery]")
    source, resistance = battery.cells * CELL_VOLTAGE, battery.cells * battery.cell_resistance
    left = source * source - 4.0 * resistance * watts  # of V (source - V) = resistance * watts
    if left < 0.0:
        raise ValueError(f"the battery cannot give {watts:.0f} W at {CELL_VOLTAGE} V a cell")
    return 2.0 * watts / (source + math.sqrt(left))


def throttle(airframe: Airframe, density: float = DENSITY, rotor: Rotor | None = None) -> float:
    """Return the voltage of the hardest-turning motor in hover over its maximum."""
    return trim(airframe, 0.0, density, rotor=rotor).voltage / airframe.motor.max_voltage


def motor_current(airframe: Airframe, density: float = DENSITY, rotor: Rotor | None = None) -> float:
    """Return the current [A] of the hardest-turning motor in hover."""
    return trim(airframe, 0.0, density, rotor=rotor).current


def esc_margin(airframe: Airframe, density: float = DENSITY, rotor: Rotor | None = None) -> float:
    """Return the share of a speed controller's current limit that is free in hover; negative beyond the limit."""
    return 1.0 - motor_current(airframe, density, rotor) / airframe.motor.esc_current


def battery_margin(airframe: Airframe, density: float = DENSITY, rotor: Rotor | None = None) -> float:
    """Return the share of the battery's current limit (C rating) that is free in hover; negative beyond it."""
    load = current(airframe, density, rotor)
    assert airframe.battery is not None  # otherwise `current` raises an error
    return 1.0 - load / airframe.battery.current_limit
