"""Rotors with the induced velocity as a state: climb, descent, and translational lift."""

from typing import NamedTuple

from lapwing.dynamics.effects._axes import hub_speeds
from lapwing.dynamics.effects._from_scene import Airframe, reject, validate_table
from lapwing.dynamics.effects._hooks import decay_rate, loads, memory_rate, switches
from lapwing.dynamics.effects._rotor_sums import with_changes
from lapwing.dynamics.effects.axial_inflow import KIND, SUDDEN, fastest_spin
from lapwing.dynamics.vector import pair
from lapwing.dynamics.vehicles import inflow
from lapwing.dynamics.vehicles.propeller import hover_flow, thrust_constant
from lapwing.kernels import always_inline, kernel, math
from lapwing.kernels.codegen import map_tuple, reduce_tuple

__all__ = ["KIND", "DynamicInflow", "Settings"]

APPARENT_MASS = 0.637  # of the sphere of air around the disc
SLOWEST = 1e-3  # [m/s] lower limit of the induced velocity in ratios
SLOWEST_FLOW, FASTEST_FLOW = -0.5, 1.5  # limits of the flow through the disc over the pitch speed
LARGEST_SHARE = 0.9  # limit of the induced velocity in hover over the pitch speed


class Settings(NamedTuple):
    """No keys: the parameters are in the airframe's [propeller]."""


class DynamicInflow(NamedTuple):
    """Change of the static loads of `rotor_thrust` by the flow through the rotor (theory, eq. (2.35), (2.36)).

    The inflow is the axial air speed plus the induced velocity: momentum theory in climb and forward flight (Glauert),
    a fit to measurements in descent, multiplied by the propeller's induced power factor. Sources:
    Leishman, Principles of Helicopter Aerodynamics, section 2.13; time constant of the flow: Carpenter and Fridovich,
    NACA TN 3044 (1953). Valid for blades that do not stall; integrated with the motion. In the vortex ring
    state it is the mean flow; `vortex_ring` adds loss and fluctuation.
    """

    slope: float  # [m^3/rad] -dT / (density speed dV)
    static: float  # [m^4/rad^2] thrust constant
    pitch: float  # [m/rad] of the blades
    hover: float  # [m/rad] induced velocity in hover over the rotor's speed
    area: float  # [m^2] of the disc
    mass: float  # [m^3] apparent mass over the density
    kappa: float  # induced velocity in hover over the ideal one
    at_rest: tuple[float, ...]  # [m/s] a zero for each rotor

    @classmethod
    def from_scene(cls, table: dict, airframe: Airframe) -> "DynamicInflow":
        """Return the parameters of the airframe's propeller."""
        validate_table(Settings, table)
        propeller = airframe.propeller or reject("the vehicle has no [propeller]")
        radius, pitch = 0.5 * propeller.diameter, propeller.pitch / (2.0 * math.pi)
        static, area = thrust_constant(propeller), math.pi * radius * radius
        kappa = propeller.induced_power_factor
        hover = kappa * hover_flow(propeller)
        if hover > LARGEST_SHARE * pitch:
            least = 2.0 * math.pi * hover / LARGEST_SHARE
            reject(
                f"the propeller's pitch must be at least {least:.3g} m for its static thrust: got {propeller.pitch:g} m"
            )
        mass = APPARENT_MASS * 4.0 / 3.0 * math.pi * (radius * radius * radius)
        at_rest = (0.0,) * len(airframe.rotors.position)
        return cls(static / (pitch - hover), static, pitch, hover, area, mass, kappa, at_rest)

    def initial_discrete_state(self) -> tuple[float, ...]:
        """Return the induced velocity of each rotor [m/s]."""
        return self.at_rest


@always_inline
def _through(e, axial, speed, induced):
    """Return the air speed through the disc [m/s], clamped to the range without stall and strong braking."""
    blades = e.pitch * speed
    return min(max(axial + induced, SLOWEST_FLOW * blades), FASTEST_FLOW * blades)


@kernel
def _approach(e, induced, both):
    """Return the rate [m/s^2] at which a rotor's induced velocity approaches that of its present thrust."""
    speed, (axial, across) = both
    square = 0.5 * e.slope / e.area * speed * (e.pitch * speed - _through(e, axial, speed, induced))
    hover = max(math.sqrt(max(square, 0.0)), SLOWEST)
    steady = hover * inflow.induced_velocity(axial / hover, across / hover, e.kappa)
    return 4.0 * e.area * hover / (e.mass * e.kappa) * (steady - induced)


@memory_rate(DynamicInflow)
def follow(e, memory, s, rotors):
    """Return the rate of the induced velocity of each rotor [m/s^2]."""
    return map_tuple(_approach, e, memory, map_tuple(pair, 0.0, s.motion.rotor_speed, hub_speeds(s)))


@decay_rate(DynamicInflow)
def fastest_approach(e, memory, motion, body, layout):
    """Return the rate [1/s] about the strongest thrust at full speed; the thrust falls as the flow grows."""
    speed = layout.speed_per_volt * layout.max_voltage
    hover = speed * math.sqrt(0.5 * e.slope / e.area * (1.0 - SLOWEST_FLOW) * e.pitch)
    return (4.0 * e.area / e.kappa * hover + e.slope * speed) / e.mass


@always_inline
def _change(e, both, hub):
    """Return (change of thrust [N], change of torque [N m]) at a density of 1."""
    speed, induced = both
    through = _through(e, hub[0], speed, induced)
    thrust = e.slope * (e.pitch * speed - through)  # over the speed
    torque = thrust * through - e.static * e.hover * speed * speed
    return speed * e.slope * (e.hover * speed - through), torque


@loads(DynamicInflow)
def dynamic_inflow(e, memory, s, factors, before):
    """Add the loads of each rotor to `before`."""
    change = map_tuple(_change, e, map_tuple(pair, 0.0, s.motion.rotor_speed, memory), hub_speeds(s))
    return with_changes(s, factors, before, change)


@always_inline
def _reaches(c, reached, both, hub):
    pitch, layout, h = c
    speed, induced = both
    flow, blades = hub[0] + induced, pitch * speed
    off = min(abs(flow - SLOWEST_FLOW * blades), abs(flow - blades), abs(flow - FASTEST_FLOW * blades))
    return reached or off <= h * (SUDDEN + FASTEST_FLOW * pitch * fastest_spin(layout, speed))


@switches(DynamicInflow)
def reaches_limit(e, memory, s, voltage, h):
    """Return True if the flow through a disc can reach a limit, or the thrust zero, where its root has no slope."""
    both = map_tuple(pair, 0.0, s.motion.rotor_speed, memory)
    return reduce_tuple(_reaches, (e.pitch, s.layout, h), False, both, hub_speeds(s))
