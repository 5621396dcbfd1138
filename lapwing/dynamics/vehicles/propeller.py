"""Thrust and torque coefficients of a propeller from its geometry (theory, eq. (1.9) to (1.11))."""

from typing import TYPE_CHECKING

from lapwing.dynamics.config_error import ConfigError
from lapwing.kernels import math

if TYPE_CHECKING:  # services do not import pydantic
    from lapwing.dynamics.vehicles.airframe_tables import Propeller


def blade_angle(propeller: "Propeller") -> float:
    """Return the effective angle of attack of the blade section at rest [rad], already divided by 1 + K_0 / (pi A)."""
    geometric = math.atan(propeller.pitch / (math.pi * propeller.diameter))
    angle = propeller.downwash_factor * geometric - propeller.zero_lift_angle
    return angle / (1.0 + propeller.lift_curve_slope / (math.pi * propeller.aspect_ratio))


def thrust_coefficient(propeller: "Propeller") -> float:
    """Return C_T: thrust over density times (revolutions per second)^2 times diameter^4 (theory, eq. (1.9))."""
    lift = propeller.lift_curve_slope * blade_angle(propeller) / propeller.aspect_ratio
    blades = propeller.lift_correction * math.square(propeller.radius_weight) * propeller.blades
    return 0.25 * math.square(math.pi) * blades * lift


def drag_coefficients(propeller: "Propeller") -> tuple[float, float]:
    """Return (zero-lift, lift-induced) drag coefficients of the blade section (theory, eq. (1.11))."""
    lift = propeller.lift_curve_slope * blade_angle(propeller)
    induced = lift * lift / (math.pi * propeller.aspect_ratio * propeller.oswald_factor)
    return propeller.zero_lift_drag, induced


def thrust_constant(propeller: "Propeller") -> float:
    """Return the static thrust over air density and squared rotor speed [m^4/rad^2]: C_T D^4 / (4 pi^2)."""
    return thrust_coefficient(propeller) * math.pow(propeller.diameter, 4) / math.square(2.0 * math.pi)


def torque_constant(propeller: "Propeller") -> float:
    """Return the static torque over air density and squared rotor speed [m^5/rad^2]: C_M D^5 / (4 pi^2)."""
    return torque_coefficient(propeller) * math.pow(propeller.diameter, 5) / math.square(2.0 * math.pi)


def hover_flow(propeller: "Propeller") -> float:
    """Return the induced velocity in hover over the rotor speed [m/rad], by momentum theory."""
    radius = 0.5 * propeller.diameter
    return math.sqrt(0.5 * thrust_constant(propeller) / (math.pi * radius * radius))


def from_stand(
    propeller: "Propeller", density: float, speed: float, thrust: float, torque: float
) -> tuple[float, float]:
    """Return the (lift_correction, zero_lift_drag) that reproduce a thrust-stand measurement.

    Args:
        propeller: geometry; its values of these two constants are ignored.
        density: air density of the measurement [kg/m^3].
        speed: rotor speed [rad/s].
        thrust: [N] at that speed.
        torque: [N m] at that speed.

    Raises:
        ConfigError: no propeller of this geometry has these values.
    """
    n = speed / (2.0 * math.pi)
    full = propeller.model_copy(update={"lift_correction": 1.0})
    lift_correction = thrust / (density * (n * n) * math.pow(propeller.diameter, 4)) / thrust_coefficient(full)
    weight = lift_correction * math.square(propeller.radius_weight * propeller.blades)
    power = density * (n * n) * math.pow(propeller.diameter, 5)
    drag = 8.0 * propeller.aspect_ratio * torque / power / (math.square(math.pi) * weight)
    zero_lift_drag = drag - drag_coefficients(propeller)[1]
    if lift_correction > 1.0:
        message = f"{thrust:g} N at {speed:g} rad/s is more than a propeller of this geometry can produce"
        expected = f"at most {thrust / lift_correction:.3g} N, a higher speed or pitch, or a downwash_factor nearer 1"
        raise ConfigError("thrust", message, expected)
    if zero_lift_drag < 0.0:
        least = torque * drag_coefficients(propeller)[1] / drag
        message = f"{torque:g} N m at {speed:g} rad/s is less than a thrust of {thrust:g} N needs"
        raise ConfigError("torque", message, f"at least {least:.3g} N m, or less thrust")
    return lift_correction, zero_lift_drag


def h_force_coefficient(propeller: "Propeller") -> float:
    """Return the in-plane drag coefficient [m^3/rad] over density, rotor speed and velocity (theory, eq. (2.11))."""
    radius = 0.5 * propeller.diameter
    blade_area = propeller.blades * radius * propeller.diameter / propeller.aspect_ratio
    return blade_area * math.total(drag_coefficients(propeller)) * radius / 4.0


def torque_coefficient(propeller: "Propeller") -> float:
    """Return C_M: torque over density times (revolutions per second)^2 times diameter^5 (theory, eq. (1.10))."""
    blades = propeller.lift_correction * math.square(propeller.radius_weight * propeller.blades)
    return math.square(math.pi) * blades * math.total(drag_coefficients(propeller)) / (8.0 * propeller.aspect_ratio)
