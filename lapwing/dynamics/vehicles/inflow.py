"""Induced velocity of a rotor by momentum theory, with its fit to measurements in descent (theory.md, eq. (2.35))."""

import math

from lapwing.kernels import always_inline, kernel

# measured between hover and the windmill brake state: powers of the climb over the induced velocity in hover
DESCENT = (1.0, -1.125, -1.372, -1.718, -0.655)
WINDMILL = -2.0  # climb over the induced velocity in hover, below which a rotor is in the windmill brake state
NEWTON_STEPS = 12  # from ten hover velocities across to a rounding
WAKE_STEPS = 8  # from no wake to a rounding


@always_inline
def axial(climb):
    """Induced velocity in climb or descent, both over that in hover; without a wind across the axis."""
    if climb >= 0.0:
        return -0.5 * climb + math.sqrt(0.25 * climb * climb + 1.0)
    if climb > WINDMILL:
        a, b, c, d, e = DESCENT
        return a + climb * (b + climb * (c + climb * (d + climb * e)))
    return -0.5 * climb - math.sqrt(0.25 * climb * climb - 1.0)


@kernel
def induced_velocity(climb, across):
    """Induced velocity of a rotor for a given thrust, over that in hover.

    Args:
        climb: air speed along the axis, against the flow that the rotor makes, over the induced velocity in hover.
        across: air speed across it, over the same; not negative.
    """
    # Glauert: v sqrt(across^2 + (climb + v)^2) = 1, its largest root from above
    upper = -0.5 * climb + math.sqrt(0.25 * climb * climb + 1.0)
    v = min(upper, 1.0 / max(across, 1e-9))
    for _ in range(NEWTON_STEPS):
        through = climb + v
        square = across * across + through * through
        v -= (v * v * square - 1.0) / (2.0 * v * (square + v * through))
    # what the ring of vortices adds in descent is blown away by a wind across as fast as the flow in hover
    return v if climb >= 0.0 else v * (1.0 + max(1.0 - across, 0.0) * (axial(climb) / upper - 1.0))


@kernel
def thrust_in_wake(pitch, wash):
    """Thrust of a rotor in the contracted wake of another one, over that at the same speed by itself; 0 to 1.

    Theory.md, eqs. (2.43) and (2.44).

    Args:
        pitch: way of the blades a radian, over the induced velocity in hover by itself a radian a second; above 1.
        wash: induced velocity of the upper rotor over the lower one's in hover by itself.
    """
    if wash >= pitch:
        return 0.0  # the wake is as fast as the blades
    slope, square = pitch - 1.0, wash * wash
    cube = square * wash
    t = 1.0
    for _ in range(WAKE_STEPS):  # of Newton's method, from above
        through, sum_ = pitch - slope * t, t + square
        value = t * through * through + cube * through - sum_ * sum_
        growth = through * through - 2.0 * slope * t * through - slope * cube - 2.0 * sum_
        t = min(max(t - value / growth, 0.0), 1.0)
    return t
