"""PID loop with anti-windup (theory, eq. (4.10))."""

from typing import NamedTuple

from lapwing.kernels import always_inline


class Pid(NamedTuple):
    """Gains in output units u over error units e, with a common sign."""

    p: float  # [u/e]
    i: float  # [u/(e s)]
    d: float  # [u s/e]


@always_inline
def integrate(gains: Pid, integral: float, error: float, cut: float, dt: float) -> float:
    """Return the integral of the error [e s] after dt [s], held if it would increase saturation.

    `cut` is the sign of the part of the last output that saturation removed, 0 without saturation.
    """
    return integral if gains.i * error * cut > 0.0 else integral + dt * error


@always_inline
def output(gains: Pid, integral: float, error: float, error_rate: float) -> float:
    """Return P error + I integral + D error_rate [u]."""
    return gains.p * error + gains.i * integral + gains.d * error_rate
