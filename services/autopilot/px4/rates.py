"""Rate loop of the PX4 cascade: PID with gain K, feed-forward and anti-windup, to normalised torque."""

from typing import NamedTuple

from lapwing.dynamics.vector import Vec3
from lapwing.kernels import always_inline, math
from lapwing.services.autopilot.mixer import clamp

FULL_ERROR = math.radians(400.0)  # [rad/s] error at which the integral no longer grows


class Parameters(NamedTuple):
    """Gains of the rate loop about body x, y, z; normalised torque over [rad/s]. K scales P, I and D."""

    p: Vec3  # K P
    i: Vec3  # K I
    d: Vec3  # K D
    forward: Vec3
    integral_limit: Vec3  # normalised torque
    derivative_cutoff: float  # [Hz] of the first-order filter of the angular acceleration


@always_inline
def low_pass(cutoff: float, dt: float, before: Vec3, value: Vec3) -> Vec3:
    """Return the output of a first-order low-pass filter of `cutoff` [Hz] after dt [s]; 0 Hz: no filter."""
    part = 1.0 - math.exp(-2.0 * math.pi * cutoff * dt) if cutoff > 0.0 else 1.0
    return (
        before[0] + part * (value[0] - before[0]),
        before[1] + part * (value[1] - before[1]),
        before[2] + part * (value[2] - before[2]),
    )


@always_inline
def _torque(p: Parameters, k: int, error: float, integral: float, acceleration: float, setpoint: float) -> float:
    return p.p[k] * error + integral - p.d[k] * acceleration + p.forward[k] * setpoint


@always_inline
def torque_setpoint(p: Parameters, setpoint: Vec3, omega: Vec3, acceleration: Vec3, integral: Vec3) -> Vec3:
    """Return the normalised torque.

    Args:
        p: parameters.
        setpoint: of omega_body [rad/s].
        omega: omega_body [rad/s].
        acceleration: its filtered derivative [rad/s^2].
        integral: integral term, normalised torque.
    """
    return (
        _torque(p, 0, setpoint[0] - omega[0], integral[0], acceleration[0], setpoint[0]),
        _torque(p, 1, setpoint[1] - omega[1], integral[1], acceleration[1], setpoint[1]),
        _torque(p, 2, setpoint[2] - omega[2], integral[2], acceleration[2], setpoint[2]),
    )


@always_inline
def _growth(gain: float, error: float, cut: float, dt: float) -> float:
    if error * cut > 0.0:
        return 0.0
    return max(0.0, 1.0 - math.square(error / FULL_ERROR)) * gain * error * dt


@always_inline
def rate_integral(p: Parameters, integral: Vec3, error: Vec3, cut: Vec3, dt: float) -> Vec3:
    """Return the integral term after dt [s].

    It is constant where it would increase saturation, and grows less with large errors, such as after a flip.

    Args:
        p: parameters.
        integral: before, normalised torque.
        error: of omega_body [rad/s].
        cut: sign of the part of the torque that saturation removed.
        dt: length of the tick [s].
    """
    x, y, z = integral
    limit = p.integral_limit
    return (
        clamp(x + _growth(p.i[0], error[0], cut[0], dt), -limit[0], limit[0]),
        clamp(y + _growth(p.i[1], error[1], cut[1], dt), -limit[1], limit[1]),
        clamp(z + _growth(p.i[2], error[2], cut[2], dt), -limit[2], limit[2]),
    )
