"""Thrust and torque coefficients of a propeller from its geometry (theory.md, eq. (1.9) to (1.11))."""

import math
from typing import TYPE_CHECKING

if TYPE_CHECKING:  # a process that flies has no need of pydantic
    from dynamics.vehicles.airframe import Propeller


def blade_angle(propeller: "Propeller") -> float:
    """Effective angle of attack of the blade section at rest [rad], already divided by 1 + K_0 / (pi A)."""
    geometric = math.atan(propeller.pitch / (math.pi * propeller.diameter))
    angle = propeller.downwash_factor * geometric - propeller.zero_lift_angle
    return angle / (1.0 + propeller.lift_curve_slope / (math.pi * propeller.aspect_ratio))


def thrust_coefficient(propeller: "Propeller") -> float:
    """C_T: thrust over density times (revolutions per second)^2 times diameter^4 (theory.md, eq. (1.9))."""
    lift = propeller.lift_curve_slope * blade_angle(propeller) / propeller.aspect_ratio
    blades = propeller.lift_correction * propeller.radius_weight**2 * propeller.blades
    return 0.25 * math.pi**2 * blades * lift


def drag_coefficients(propeller: "Propeller") -> tuple[float, float]:
    """Of the blade section: (zero-lift part, part induced by lift) (theory.md, eq. (1.11))."""
    lift = propeller.lift_curve_slope * blade_angle(propeller)
    induced = lift**2 / (math.pi * propeller.aspect_ratio * propeller.oswald_factor)
    return propeller.zero_lift_drag, induced


def torque_coefficient(propeller: "Propeller") -> float:
    """C_M: torque over density times (revolutions per second)^2 times diameter^5 (theory.md, eq. (1.10))."""
    blades = propeller.lift_correction * propeller.radius_weight**2 * propeller.blades**2
    return math.pi**2 * blades * sum(drag_coefficients(propeller)) / (8.0 * propeller.aspect_ratio)
