"""Mixer: virtual controls to rotor thrusts with prioritised saturation (theory, eqs. (4.20)-(4.23), (4.28))."""

import math
from collections.abc import Mapping
from typing import NamedTuple

from lapwing.kernels import always_inline
from lapwing.kernels.codegen import map_tuple
from lapwing.services.common.ports import PerRotor

Share = tuple[float, float, float, float]  # share of a rotor in collective, roll, pitch, yaw
Shares = tuple[Share, ...]  # shares of every rotor
# MC_AIRMODE: virtual controls for which the collective is raised
AIRMODE_DISABLED, AIRMODE_ROLL_PITCH, AIRMODE_ROLL_PITCH_YAW = 0, 1, 2


class VirtualControls(NamedTuple):
    """Virtual controls: mean force per rotor [N] that each loop commands; multiplied by the shares of a rotor."""

    collective: float
    roll: float  # positive turns about body x (left side up)
    pitch: float  # positive turns about body y (nose down)
    yaw: float  # positive turns about body z (to the left)


@always_inline
def _zero(_: float, share: Share, other: Share) -> float:
    return 0.0


@always_inline
def zero_thrust(shares: Shares) -> PerRotor:
    """Return zero thrust [N] for every rotor."""
    return map_tuple(_zero, 0.0, shares, shares)


@always_inline
def active_allocation(tables: tuple[Shares, ...], failed: int) -> Shares:
    """Return the shares for a failed rotor, by its number from 1; those of all rotors if there is no such table."""
    return tables[failed if failed < len(tables) else 0]


@always_inline
def _thrust(q: VirtualControls, share: Share, _: Share) -> float:
    return share[0] * q.collective + share[1] * q.roll + share[2] * q.pitch + share[3] * q.yaw


@always_inline
def mix(shares: Shares, q: VirtualControls) -> PerRotor:
    """Return the unsaturated rotor thrusts [N] of virtual controls q."""
    return map_tuple(_thrust, q, shares, shares)


@always_inline
def clamp(x: float, low: float, high: float) -> float:
    """Return the nearest value to x in [low, high]."""
    return min(max(x, low), high)


@always_inline
def _clamp(highest: float, value: float, _: float) -> float:
    return clamp(value, 0.0, highest)


@always_inline
def clamp_to_range(values: PerRotor, highest: float) -> PerRotor:
    """Return the nearest values within 0..highest."""
    return map_tuple(_clamp, highest, values, values)


@always_inline
def _scaled(factor: float, value: float, _: float) -> float:
    return factor * value


@always_inline
def scale_all(factor: float, values: PerRotor) -> PerRotor:
    """Return the values multiplied by a factor."""
    return map_tuple(_scaled, factor, values, values)


def airmode(values: Mapping[str, float]) -> int:
    """Return the air mode that the autopilot's parameters select."""
    return int(values.get("MC_AIRMODE", AIRMODE_ROLL_PITCH))  # not in logs of former versions


@always_inline
def _feasible_yaw(shares: Shares, roll: float, pitch: float, yaw: float, thrust_max: float) -> float:
    """Return the part of a yaw control that is feasible with roll and pitch at any collective."""
    part = 1.0
    for s in shares:
        for t in shares:
            if s[0] > 0.0 and t[0] > 0.0:
                tilt = (s[1] * roll + s[2] * pitch) / s[0] - (t[1] * roll + t[2] * pitch) / t[0]
                turn = (s[3] / s[0] - t[3] / t[0]) * yaw
                if turn > 0.0:  # may be due to rounding, hence the lower limit of the range
                    part = min(part, max(thrust_max / s[0] - tilt, 1e-12) / turn)
    return part * yaw


@always_inline
def saturate(shares: Shares, q: VirtualControls, thrust_max: float, airmode: int) -> VirtualControls:
    """Return the nearest virtual controls with thrusts of 0..thrust_max [N] (theory, eqs. (4.21)-(4.23)).

    Priority: roll and pitch, then collective, then yaw within the remaining range. Failed rotors, which have no share
    of the collective, are ignored.

    Args:
        shares: shares of every rotor.
        q: virtual controls.
        thrust_max: of a rotor [N].
        airmode: AIRMODE_DISABLED reduces roll and pitch where they would raise the collective;
            AIRMODE_ROLL_PITCH_YAW keeps yaw before the collective.
    """
    lowest = math.inf  # minimum roll and pitch thrust of a rotor, over its share of the collective
    for s in shares:
        if s[0] > 0.0:
            lowest = min(lowest, (s[1] * q.roll + s[2] * q.pitch) / s[0])
    part = 1.0
    if airmode == AIRMODE_DISABLED:
        part = min(part, max(q.collective, 0.0) / max(-lowest, 1e-9))
    for s in shares:
        if s[0] > 0.0:
            span = (s[1] * q.roll + s[2] * q.pitch) / s[0] - lowest
            part = min(part, thrust_max / s[0] / max(span, 1e-9))
    roll, pitch, yaw = part * q.roll, part * q.pitch, q.yaw
    if airmode == AIRMODE_ROLL_PITCH_YAW:
        yaw = _feasible_yaw(shares, roll, pitch, yaw, thrust_max)
    low, high = -math.inf, math.inf
    for s in shares:
        if s[0] > 0.0:
            tilt = part * ((s[1] * q.roll + s[2] * q.pitch) / s[0])
            if airmode == AIRMODE_ROLL_PITCH_YAW:
                tilt += s[3] * yaw / s[0]
            low, high = max(low, -tilt), min(high, thrust_max / s[0] - tilt)
    collective = clamp(q.collective, low, high)
    low, high = -math.inf, math.inf
    for s in shares:
        if s[3] != 0.0:
            without_yaw = s[0] * collective + s[1] * roll + s[2] * pitch
            up, down = (thrust_max - without_yaw) / s[3], -without_yaw / s[3]
            low, high = max(low, min(up, down)), min(high, max(up, down))
    return VirtualControls(collective, roll, pitch, clamp(yaw, min(low, 0.0), max(high, 0.0)))
