"""Interference of neighbouring rotors in forward flight.

The flow about a uniform rotor is that of a skewed cylinder of vortex rings (theory, eq. (2.73)).
After Coleman, Feingold and Stempin, NACA ARR L5E10 (1945), and Castles and De Leeuw, NACA TR 1184 (1954); the integral
along the wake is taken in closed form, that around it by the trapezoidal rule.
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from lapwing.dynamics.effects._axes import air_body, hub_speeds
from lapwing.dynamics.effects._from_scene import Airframe, check_beside, pitch_and_flow, reject, validate_table
from lapwing.dynamics.effects._hooks import loads
from lapwing.dynamics.effects._rotor_sums import with_changes
from lapwing.dynamics.vector import pair
from lapwing.dynamics.vehicles import inflow
from lapwing.dynamics.vehicles.propeller import thrust_constant
from lapwing.kernels import always_inline, kernel, math, noinline
from lapwing.kernels.codegen import map_tuple

ELEMENTS = 180  # of the circumference
FLATTEST = 8.0  # greatest tangent of the wake's skew; flatter wakes are taken for this
SKEWS = tuple(k / 8.0 for k in range(9))  # speed across over the sum of those across and through the disc
OFFSETS = tuple(k / 12.0 for k in range(13))  # sine of half the angle off straight behind
RINGS, PLACES = 4, 16  # rings of equal area on a disc, and places on each, for its mean


@kernel
def normal_flow(tangent, x, y, z):
    """Return the flow along a rotor's axis at a place over that at the rotor's centre.

    Args:
        tangent: of the wake's skew, 0 straight below the disc.
        x: place in radii, downstream in the disc's plane.
        y: in radii, across the stream in the disc's plane.
        z: in radii, above the disc.
    """
    length = math.sqrt(1.0 + tangent * tangent)
    ex, ez = tangent / length, -1.0 / length  # direction of the wake
    total = 0.0
    for k in range(ELEMENTS):
        sine, cosine = math.sincos(2.0 * math.pi * (k + 0.5) / ELEMENTS)
        ax, ay = x - cosine, y - sine
        a = math.sqrt(ax * ax + ay * ay + z * z)
        along = ax * ex + z * ez
        # -z component of t x (a / |a| - e) / (|a| - a.e), t the tangent of the ring
        total -= (sine * ay / a + cosine * (ax / a - ex)) / (a - along)
    return total / ELEMENTS


@kernel
def mean_wash(skew, offset, distance):
    """Return the mean flow at a disc over that at the inducing rotor.

    Args:
        skew: speed across over the sum of those across and through the inducing disc, 0 to 1.
        offset: sine of half the angle between the disc and straight behind the inducing one, 0 to 1.
        distance: of the axes, in radii.
    """
    tangent = min(skew / max(1.0 - skew, 1e-9), FLATTEST)
    cosine = 1.0 - 2.0 * offset * offset
    x, y = distance * cosine, distance * math.sqrt(max(1.0 - cosine * cosine, 0.0))
    total = 0.0
    for i in range(RINGS):
        r = math.sqrt((i + 0.5) / RINGS)
        for k in range(PLACES):
            sine, cosine = math.sincos(2.0 * math.pi * (k + 0.25) / PLACES)
            total += normal_flow(tangent, x + r * cosine, y + r * sine, 0.0)
    return total / (RINGS * PLACES)


NEAREST = 0.5  # radii between axes; nearer rotors are coaxial
SAME = 1e-6  # [m] tolerance within which distances share a table
SLOWEST = 1e-3  # [m/s] lower limit of the induced velocity in ratios
NOT_BESIDE = ("coaxial_interference", "rotor_quadratic", "rotor_table")


class Settings(NamedTuple):
    """No keys: the parameters are in the airframe's [propeller] and [rotors]."""


class RotorInterference(NamedTuple):
    """Change of static loads by the induced flow of the other rotors (theory, eq. (2.73) to (2.75)).

    Source: skewed cylinder of vortex rings of Castles and De Leeuw, NACA TR 1184 (1954), its mean over each disc; flow
    of each rotor by Glauert; blades of one pitch as in `dynamic_inflow`. Zero in hover. Valid for rotors in one plane,
    uniform discs, and wakes that neither roll up nor bend each other.
    """

    thrust_constant: float  # [m^4/rad^2]
    slope: float  # [m^3/rad] -dT / (density speed dV)
    flow: float  # [m/rad] induced velocity in hover over the rotor's speed
    area: float  # [m^2] of the disc
    numbers: tuple[int, ...]  # of the rotors
    pairs: tuple[
        tuple[tuple[float, float, int], ...], ...
    ]  # for each pair of rotors: unit vector, table; -1: the rotor itself
    wash: np.ndarray  # mean flow at a disc over that at the inducing one, shape (tables, skews, offsets)

    @classmethod
    def from_scene(cls, table: dict, airframe: Airframe) -> "RotorInterference":
        """Return the parameters of every pair of rotors."""
        validate_table(Settings, table)
        propeller = airframe.propeller or reject("the vehicle has no [propeller]")
        radius, (pitch, flow) = 0.5 * propeller.diameter, pitch_and_flow(propeller)
        static, area = thrust_constant(propeller), math.pi * radius * radius
        places = airframe.rotors.position
        distances: list[float] = []
        pairs = []
        for k, (x, y, _) in enumerate(places):
            row = []
            for j, (u, v, _) in enumerate(places):
                distance = math.hypot(x - u, y - v)
                if j == k:
                    row.append((0.0, 0.0, -1))
                    continue
                if distance < NEAREST * radius:
                    reject("the vehicle has coaxial rotors; use effects.coaxial_interference")
                known = [n for n, d in enumerate(distances) if abs(d - distance) < SAME]
                if not known:
                    distances.append(distance)
                row.append(((x - u) / distance, (y - v) / distance, known[0] if known else len(distances) - 1))
            pairs.append(tuple(row))
        wash = np.array([[[mean_wash(w, f, d / radius) for f in OFFSETS] for w in SKEWS] for d in distances])
        return cls(static, static / (pitch - flow), flow, area, tuple(range(len(places))), tuple(pairs), wash)


def check(table: Mapping[str, Any], tables: Mapping[str, Any]) -> None:
    """Check that the scene has `rotor_thrust`, whose loads this effect changes."""
    check_beside(tables, "rotor_thrust", NOT_BESIDE)


@always_inline
def _node(count, value):
    """Return (index, weight of the next node) of a value between 0 and 1 on equally spaced nodes."""
    scaled = min(max(value, 0.0), 1.0) * (count - 1.0)
    i = min(int(scaled), count - 2)
    return i, scaled - i


@kernel
def _share(wash, number, skew, offset):
    """Return the mean flow at a disc over that at the inducing one, bilinear."""
    i, a = _node(wash.shape[1], skew)
    k, b = _node(wash.shape[2], offset)
    low = wash[number, i, k] + b * (wash[number, i, k + 1] - wash[number, i, k])
    high = wash[number, i + 1, k] + b * (wash[number, i + 1, k + 1] - wash[number, i + 1, k])
    return low + a * (high - low)


@always_inline
def _induced_velocity(e, speed, hub):
    """Return (induced velocity [m/s], air speed through the disc [m/s], air speed across [m/s])."""
    hover = max(e.flow * speed, SLOWEST)
    v = hover * inflow.induced_velocity(hub[0] / hover, hub[1] / hover, 1.0)
    return v, max(hub[0] + v, 0.0), hub[1]


@noinline
def _change(c, row, both):
    """Return (change of thrust [N], change of torque [N m]) of a rotor at a density of 1."""
    e, flows, (ahead, aside) = c
    number, speed = both
    if speed <= 0.0:
        return 0.0, 0.0
    motion = max(math.sqrt(ahead * ahead + aside * aside), 1e-9)
    flow = 0.0
    for j in range(len(row)):
        x, y, table = row[j]
        if table >= 0:
            v, through, across = flows[j]
            skew = across / max(across + through, 1e-9)
            # downstream is against the motion through the air: 0 straight behind, 1 straight ahead
            offset = math.sqrt(max(0.5 + 0.5 * (x * ahead + y * aside) / motion, 0.0))
            flow += v * _share(e.wash, table, skew, offset)
    v, through, across = flows[number]
    disc = 2.0 * e.area * (math.sqrt(across * across + through * through) + v)  # dT / (density dv) of the disc
    blades = e.slope * speed
    thrust = -blades * flow / (1.0 + blades / max(disc, 1e-9))  # the rotor's own flow shrinks with its thrust
    own = thrust / max(disc, 1e-9)
    static = e.thrust_constant * speed * speed
    return thrust, (thrust * through + static * (flow + own)) / speed


@loads(RotorInterference)
def rotor_interference(e, memory, s, factors, before):
    """Add the loads of each rotor to `before`."""
    speed = s.motion.rotor_speed
    air, _ = air_body(s)
    flows = map_tuple(_induced_velocity, e, speed, hub_speeds(s))
    change = map_tuple(_change, (e, flows, (air[0], air[1])), e.pairs, map_tuple(pair, 0.0, e.numbers, speed))
    return with_changes(s, factors, before, change)
