"""Closed form of a free body that hits a damped spring which only pushes."""

import math


def rebound(gap: float, speed: float, frequency: float, ratio: float, seconds: float) -> tuple[float, float]:
    """Return (distance [m] beyond the spring's end, speed [m/s]) of a body after it has left the spring again.

    Coast over the gap, half an oscillation until the force is zero, coast back.

    Args:
        gap: [m] from the body to the end of the spring at the start.
        speed: [m/s] towards the spring.
        frequency: [rad/s] of the undamped oscillation.
        ratio: of the damping to the critical one, below 1.
        seconds: from the start.
    """
    root = math.sqrt(1.0 - ratio**2)
    damped = frequency * root
    ends = math.atan2(2.0 * ratio * root, 2.0 * ratio**2 - 1.0) / damped  # the force is zero
    decay = speed * math.exp(-ratio * frequency * ends)
    depth = decay * math.sin(damped * ends) / damped
    rate = decay * (math.cos(damped * ends) - ratio * frequency / damped * math.sin(damped * ends))
    return depth + rate * (seconds - gap / speed - ends), rate
