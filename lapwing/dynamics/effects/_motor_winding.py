"""Winding of a motor with inductance: constants and transient currents (theory, eq. (2.76)).

Functions take the constants of a winding, or () without inductance; the choice is part of the type.
"""

import math

from lapwing.dynamics.config_error import ConfigError
from lapwing.dynamics.effects._axes import by_axis
from lapwing.kernels import always_inline
from lapwing.kernels import math as exact
from lapwing.kernels.codegen import map_tuple

LARGEST = 0.9  # of the inductance at which speed and current oscillate
RESOLVED = 0.1  # longest step times decay rate of a transient that a step resolves without error control
NONE = -0.0  # [A] neutral element of addition, also for the sign of 0.0: the compiler removes it


def winding_constants(
    inductance: float, resistance: float, constant: float, efficiency: float, inertia: float
) -> tuple:
    """Return (lag, effective inverse inertia, rate) from the roots of the linear motor."""
    electrical = inductance / resistance
    mechanical = inertia * resistance / (efficiency * constant * constant)
    if 4.0 * electrical >= LARGEST * mechanical:
        most = 0.25 * LARGEST * mechanical * resistance
        raise ConfigError("inductance", f"got {inductance:g} H", f"at most {most:.2g} H for this motor")
    root = math.sqrt(1.0 - 4.0 * electrical / mechanical)
    slow, fast = 2.0 / (mechanical * (1.0 + root)), (1.0 + root) / (2.0 * electrical)  # [1/s]
    lag = constant * inductance / (resistance * (resistance - inductance * slow))
    return lag, 1.0 / (inertia - efficiency * constant * lag), fast


@always_inline
def _none(_, __, ___):
    return NONE


@always_inline
def _without_inductance(arguments):
    _, __, ___, voltage = arguments
    return map_tuple(_none, 0.0, voltage, voltage)


@always_inline
def _remaining(decay, winding, _):
    return decay * winding[0]


@always_inline
def _with_inductance(arguments):
    constants, memory, t, _ = arguments
    start, windings = memory
    return map_tuple(_remaining, exact.exp(-constants[2] * (t - start)), windings, windings)


@always_inline
def transient_currents(constants, memory, t, voltage):
    """Return the transient current [A] of each winding at a time [s]."""
    return by_axis(_without_inductance, _with_inductance, constants, (constants, memory, t, voltage))


@always_inline
def _never(_):
    return False


@always_inline
def _fast(arguments):
    constants, h = arguments
    return constants[2] * h > RESOLVED


@always_inline
def decays_within(constants, h):
    """Return True if transient currents decay so fast that a step of h [s] needs error control."""
    return by_axis(_never, _fast, constants, (constants, h))
