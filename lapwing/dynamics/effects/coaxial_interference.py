"""Thrust loss of a rotor in the wake of a rotor above it."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from lapwing.dynamics import small_matrices
from lapwing.dynamics.effects._axes import hub_speeds
from lapwing.dynamics.effects._from_scene import Airframe, check_beside, pitch_and_flow, reject, validate_table
from lapwing.dynamics.effects._hooks import loads
from lapwing.dynamics.effects._rotor_sums import with_changes
from lapwing.dynamics.effects._types import PerRotor, WakeSlopes
from lapwing.dynamics.vector import pair
from lapwing.dynamics.vehicles import inflow
from lapwing.dynamics.vehicles.propeller import thrust_constant
from lapwing.kernels import always_inline, math, python_function
from lapwing.kernels.codegen import map_tuple

CONTRACTED = math.sqrt(0.5)  # radius of the wake over the radius of the disc
ASIDE = 1.0 - CONTRACTED  # [radii] largest distance of the axes at which the entire wake meets the lower disc
FARTHEST = 2.0  # [radii] largest distance of coaxial discs along the axis
PARALLEL = 0.99  # smallest cosine of the angle between coaxial axes
NOT_BESIDE = ("rotor_quadratic", "rotor_table", "dynamic_inflow")


class Settings(NamedTuple):
    """No keys: the parameters are in the airframe's [propeller] and [rotors]."""


class CoaxialInterference(NamedTuple):
    """Change of thrust and torque of a lower rotor in the wake of an upper rotor (theory, eq. (2.43), (2.44)).

    Momentum theory for blades of constant pitch. The inner half of the lower disc receives twice the induced velocity
    of the upper rotor. The upper rotor is modelled as isolated. Source: Leishman, Principles of Helicopter
    Aerodynamics, coaxial rotors with a contracted wake at the lower disc. Valid near hover: in fast flight the wake
    passes behind the lower rotor.
    """

    thrust_constant: float  # [m^4/rad^2]
    pitch: float  # blade pitch over the induced velocity in hover, both divided by the rotor speed
    flow: float  # [m/rad] induced velocity in hover over the rotor's speed
    radius: float  # [m]
    above: tuple[PerRotor, ...]  # for each rotor: 1 for the rotor above it, 0 for the others
    distance: PerRotor  # [m] from each rotor to the rotor above it, along the axis

    @classmethod
    def from_scene(cls, table: dict, airframe: Airframe) -> "CoaxialInterference":
        """Return the parameters of all rotors below another rotor."""
        validate_table(Settings, table)
        propeller = airframe.propeller or reject("the vehicle has no [propeller]")
        radius = 0.5 * propeller.diameter
        uppers = _uppers(airframe, radius)
        if all(number < 0 for number, _ in uppers):
            limits = f"{FARTHEST * radius:.3g} m below another with axes at most {ASIDE * radius:.3g} m apart"
            reject(f"the vehicle has no coaxial rotors; expected a rotor at most {limits}")
        pitch, flow = pitch_and_flow(propeller)
        above = tuple(tuple(float(number == j) for j in range(len(uppers))) for number, _ in uppers)
        return cls(
            thrust_constant(propeller), pitch / flow, flow, radius, above, tuple(distance for _, distance in uppers)
        )

    def changes(self, speed: float, axial: float = 0.0, across: float = 0.0) -> list[tuple[float, float]]:
        """Return the change of (thrust [N], torque [N m]) of each rotor at a density of 1, all rotors at one speed.

        Args:
            speed: rotor speed [rad/s].
            axial: air speed of the hubs along their axes [m/s].
            across: air speed across the axes [m/s].
        """
        change, wash = python_function(_change), self.flow * speed
        washes = [wash * any(above) for above in self.above]
        return [
            change(self, (speed, w), ((axial, across), distance))
            for w, distance in zip(washes, self.distance, strict=True)
        ]

    def slopes(self) -> WakeSlopes:
        """Return the coupling of thrusts and torques, all rotors at one speed in still air (theory, eq. (2.45))."""
        q, count = self.pitch, len(self.above)
        t = python_function(inflow.thrust_in_wake)(q, 1.0)
        through = q - (q - 1.0) * t
        steep = through * (through - 2.0 * (q - 1.0) * t) - (q - 1.0) - 2.0 * (t + 1.0)
        slope = (4.0 * (t + 1.0) - 3.0 * through) / steep  # of t over the speed of the wake
        power, more = t * through - 1.0, slope * (through - (q - 1.0) * t)
        thrust, torque = np.eye(count), np.zeros((count, count))
        for lower, above in enumerate(self.above):
            if any(above):
                upper = above.index(1.0)
                thrust[lower, lower], thrust[lower, upper] = t - 0.5 * slope, 0.5 * slope
                torque[lower, lower], torque[lower, upper] = self.flow * (power - 0.5 * more), 0.5 * self.flow * more
        return WakeSlopes(tuple(map(tuple, thrust.tolist())), tuple(map(tuple, torque.tolist())))


def check(table: Mapping[str, Any], tables: Mapping[str, Any]) -> None:
    """Check that the scene has `rotor_thrust`: this effect changes its loads."""
    check_beside(tables, "rotor_thrust", NOT_BESIDE)


def has_rotor_in_wake(airframe: Airframe) -> bool:
    """Return True if a rotor lies in the wake of another one."""
    propeller = airframe.propeller
    return propeller is not None and any(number >= 0 for number, _ in _uppers(airframe, 0.5 * propeller.diameter))


def _uppers(airframe: Airframe, radius: float) -> list[tuple[int, float]]:
    return [_upper(airframe, k, radius) for k in range(len(airframe.rotors.position))]


def _upper(airframe: Airframe, k: int, radius: float) -> tuple[int, float]:
    """Return (index, distance [m]) of the nearest rotor whose wake reaches rotor k; (-1, 0) if none does."""
    places = np.array(airframe.rotors.position)
    axes = np.array(airframe.rotors.tilted_axis or [(0.0, 0.0, 1.0)] * len(places))
    candidates = []
    for j, arm in enumerate(places - places[k]):
        height = small_matrices.dot(arm, axes[k])
        aside = small_matrices.length(arm - height * axes[k])
        if (
            0.0 < height <= FARTHEST * radius
            and aside <= ASIDE * radius
            and small_matrices.dot(axes[j], axes[k]) >= PARALLEL
        ):
            candidates.append((height, j))
    distance, number = min(candidates, default=(0.0, -1))
    return number, distance


@always_inline
def _square(_, speed, factor):
    return factor * speed * speed


@always_inline
def _flow(c, above, _):
    """Return the induced velocity [m/s] of the rotor above."""
    flow, squares = c
    square = 0.0
    for j in range(len(above)):
        square += above[j] * squares[j]
    return flow * math.sqrt(square)


@always_inline
def _change(e, both, place):
    """Return (change of thrust [N], change of torque [N m]) at a density of 1."""
    speed, wash = both
    (axial, across), distance = place
    along = axial + wash  # [m/s] speed of the wake
    if wash <= 0.0 or along <= 0.0 or speed <= 0.0:
        return 0.0, 0.0
    drift = distance * across / (along * e.radius)  # [radii] sideways drift of the wake at the lower disc
    share = min(max((1.0 + CONTRACTED - drift) / (2.0 * CONTRACTED), 0.0), 1.0)
    thrust = inflow.thrust_in_wake(e.pitch, share * wash / (e.flow * speed))
    through = e.pitch - thrust * (e.pitch - 1.0)
    static = e.thrust_constant * speed * speed
    return static * (thrust - 1.0), static * e.flow * (thrust * through - 1.0)


@loads(CoaxialInterference)
def coaxial_interference(e, memory, s, factors, before):
    """Add the loads of each rotor to `before`."""
    speed = s.motion.rotor_speed
    squares = map_tuple(_square, 0.0, speed, factors.thrust)
    wash = map_tuple(_flow, (e.flow, squares), e.above, e.above)
    change = map_tuple(_change, e, map_tuple(pair, 0.0, speed, wash), map_tuple(pair, 0.0, hub_speeds(s), e.distance))
    return with_changes(s, factors, before, change)
