"""Four force demands to four thrusts and back, with saturation (theory.md, eqs. (4.20)-(4.23))."""

from typing import NamedTuple

from dynamics.kernel import leaf
from dynamics.vector import Vec3
from services.autopilot.interface import Four

Signs = tuple[Vec3, Vec3, Vec3, Vec3]  # (roll, pitch, yaw) share of every rotor, each +1 or -1


class Demands(NamedTuple):
    """What each loop asks of every rotor [N]; the signs of the mixer give each rotor its share."""

    collective: float
    roll: float  # positive turns about body x (left side up)
    pitch: float  # positive turns about body y (nose down)
    yaw: float  # positive turns about body z (to the left)


@leaf
def mix(signs: Signs, q: Demands) -> Four:
    """The rotors' thrusts [N] of demands q without saturation; signs are (roll, pitch, yaw) of every rotor."""
    a, b, c, d = signs
    return (
        q.collective + a[0] * q.roll + a[1] * q.pitch + a[2] * q.yaw,
        q.collective + b[0] * q.roll + b[1] * q.pitch + b[2] * q.yaw,
        q.collective + c[0] * q.roll + c[1] * q.pitch + c[2] * q.yaw,
        q.collective + d[0] * q.roll + d[1] * q.pitch + d[2] * q.yaw,
    )


@leaf
def clamp(x: float, low: float, high: float) -> float:
    """The nearest value to x in [low, high]."""
    return min(max(x, low), high)


@leaf
def saturate(signs: Signs, q: Demands, thrust_max: float) -> Demands:
    """The nearest demands that ask every rotor for 0..thrust_max [N] (theory.md, eqs. (4.21)-(4.23)).

    Attitude comes first, then collective; yaw is given up first: it gets what room the others leave.
    """
    tilt = abs(q.roll) + abs(q.pitch)
    share = min(1.0, 0.5 * thrust_max / max(tilt, 1e-9))
    roll, pitch = share * q.roll, share * q.pitch
    tilt *= share
    collective = clamp(q.collective, tilt, thrust_max - tilt)
    bare = mix(signs, Demands(collective, roll, pitch, 0.0))
    low, high = -thrust_max, thrust_max
    for k in range(4):
        up, down = thrust_max - bare[k], -bare[k]
        if signs[k][2] < 0.0:
            up, down = -down, -up
        low, high = max(low, down), min(high, up)
    return Demands(collective, roll, pitch, clamp(q.yaw, min(low, 0.0), max(high, 0.0)))
