"""Induced velocity of a rotor by momentum theory, with its fit to measurements in descent (theory, eq. (2.35))."""

import math

from lapwing.kernels import always_inline, kernel

# measured between hover and the windmill brake state: coefficients of the first three powers of the climb over the
# induced velocity in hover; the fourth, published as -0.655, meets the windmill brake state without a jump
DESCENT = (-1.125, -1.372, -1.718)
WINDMILL = -2.0  # climb over the induced velocity in hover, below which a rotor is in the windmill brake state
NEWTON_STEPS = 12  # iterations from ten hover velocities across to round-off
WAKE_STEPS = 8  # iterations from no wake to round-off


@always_inline
def axial(climb, kappa):
    """Return the induced velocity in climb or descent without transverse flow, over the ideal one in hover.

    Args:
        climb: air speed along the axis, over the ideal induced velocity in hover.
        kappa: induced velocity in hover over the ideal one; 1 for an ideal rotor.
    """
    if climb >= 0.0:
        return kappa * (-0.5 * climb + math.sqrt(0.25 * climb * climb + 1.0))
    if climb > WINDMILL:
        b, c, d = DESCENT
        # the value at the windmill brake state is 1: 16 e = 1 - kappa + 2 b - 4 c + 8 d
        e = (1.0 - kappa + (2.0 * b - 4.0 * c + 8.0 * d)) * 0.0625
        return kappa + climb * (b + climb * (c + climb * (d + climb * e)))
    return -0.5 * climb - math.sqrt(0.25 * climb * climb - 1.0)


@kernel
def induced_velocity(climb, across, kappa):
    """Return the induced velocity of a rotor at constant thrust, over the ideal one in hover.

    Args:
        climb: air speed along the axis, against the rotor's flow, over the ideal induced velocity in hover.
        across: air speed across the axis, over the same velocity; not negative.
        kappa: induced velocity in hover over the ideal one; 1 for an ideal rotor.
    """
    # Glauert: v sqrt(across^2 + (climb + v)^2) = 1, its largest root from above
    upper = -0.5 * climb + math.sqrt(0.25 * climb * climb + 1.0)
    v = min(upper, 1.0 / max(across, 1e-9))
    for _ in range(NEWTON_STEPS):
        through = climb + v
        square = across * across + through * through
        v -= (v * v * square - 1.0) / (2.0 * v * (square + v * through))
    v *= kappa
    # a transverse wind as fast as the induced flow in hover removes the effect of the vortex ring in descent
    return v if climb >= 0.0 else v * (1.0 + max(1.0 - across, 0.0) * (axial(climb, kappa) / (kappa * upper) - 1.0))


@kernel
def thrust_in_wake(pitch, wash):
    """Return the thrust of a rotor in the contracted wake of another one, over its isolated thrust; 0 to 1.

    See theory, eqs. (2.43) and (2.44).

    Args:
        pitch: blade advance per radian over the isolated induced velocity in hover per radian per second; above 1.
        wash: induced velocity of the upper rotor over the lower one's in isolated hover.
    """
    if wash >= pitch:
        return 0.0  # the wake is as fast as the blade advance
    slope, square = pitch - 1.0, wash * wash
    cube = square * wash
    t = 1.0
    for _ in range(WAKE_STEPS):  # Newton's method, from above
        through, sum_ = pitch - slope * t, t + square
        value = t * through * through + cube * through - sum_ * sum_
        growth = through * through - 2.0 * slope * t * through - slope * cube - 2.0 * sum_
        t = min(max(t - value / growth, 0.0), 1.0)
    return t
