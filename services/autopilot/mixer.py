"""Four force demands to the rotors' thrusts, with saturation by priority (theory.md, eqs. (4.20)-(4.23), (4.28))."""

import math
from typing import NamedTuple

from lapwing.kernels import always_inline
from lapwing.kernels.codegen import map_tuple
from lapwing.services.autopilot.interface import PerRotor

Share = tuple[float, float, float, float]  # of a rotor in the demands: collective, roll, pitch, yaw
Shares = tuple[Share, ...]  # of every rotor


class VirtualControls(NamedTuple):
    """What each loop asks of every rotor [N], on the mean over the rotors; shares give each its own."""

    collective: float
    roll: float  # positive turns about body x (left side up)
    pitch: float  # positive turns about body y (nose down)
    yaw: float  # positive turns about body z (to the left)


@always_inline
def _nothing(_: float, share: Share, other: Share) -> float:
    return 0.0


@always_inline
def at_rest(shares: Shares) -> PerRotor:
    """No thrust [N] of any rotor."""
    return map_tuple(_nothing, 0.0, shares, shares)


@always_inline
def shares_in_force(tables: tuple[Shares, ...], failed: int) -> Shares:
    """The shares with a rotor failed, by its number from 1; those with all rotors where there are no others."""
    return tables[failed if failed < len(tables) else 0]


@always_inline
def _thrust(q: VirtualControls, share: Share, _: Share) -> float:
    return share[0] * q.collective + share[1] * q.roll + share[2] * q.pitch + share[3] * q.yaw


@always_inline
def mix(shares: Shares, q: VirtualControls) -> PerRotor:
    """The rotors' thrusts [N] of demands q without saturation."""
    return map_tuple(_thrust, q, shares, shares)


@always_inline
def clamp(x: float, low: float, high: float) -> float:
    """The nearest value to x in [low, high]."""
    return min(max(x, low), high)


@always_inline
def _clamped(highest: float, value: float, _: float) -> float:
    return clamp(value, 0.0, highest)


@always_inline
def possible(values: PerRotor, highest: float) -> PerRotor:
    """The nearest values within 0..highest, thrusts [N] or voltages [V]."""
    return map_tuple(_clamped, highest, values, values)


@always_inline
def saturate(shares: Shares, q: VirtualControls, thrust_max: float) -> VirtualControls:
    """The nearest demands that ask every rotor for 0..thrust_max [N] (theory.md, eqs. (4.21)-(4.23)).

    Attitude comes first, then collective; yaw is given up first: it gets what room the others leave. So demands stay
    as they are where they are possible with their yaw and without it. Rotors without a share of the collective, which
    have failed, are left out.
    """
    lowest = math.inf  # of what roll and pitch ask of a rotor, over its share of the collective
    for s in shares:
        if s[0] > 0.0:
            lowest = min(lowest, (s[1] * q.roll + s[2] * q.pitch) / s[0])
    part = 1.0
    for s in shares:
        if s[0] > 0.0:
            span = (s[1] * q.roll + s[2] * q.pitch) / s[0] - lowest
            part = min(part, thrust_max / s[0] / max(span, 1e-9))
    roll, pitch = part * q.roll, part * q.pitch
    low, high = -math.inf, math.inf
    for s in shares:
        if s[0] > 0.0:
            tilt = part * ((s[1] * q.roll + s[2] * q.pitch) / s[0])
            low, high = max(low, -tilt), min(high, thrust_max / s[0] - tilt)
    collective = clamp(q.collective, low, high)
    low, high = -math.inf, math.inf
    for s in shares:
        if s[3] != 0.0:
            bare = s[0] * collective + s[1] * roll + s[2] * pitch
            up, down = (thrust_max - bare) / s[3], -bare / s[3]
            low, high = max(low, min(up, down)), min(high, max(up, down))
    return VirtualControls(collective, roll, pitch, clamp(q.yaw, min(low, 0.0), max(high, 0.0)))
