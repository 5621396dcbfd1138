"""Internal filter of an instrument: second-order Butterworth with an additional delay (theory, eq. (3.48))."""

from typing import Annotated, NamedTuple

from annotated_types import Ge, Gt, Le

from lapwing.dynamics.config_error import ConfigError
from lapwing.dynamics.vector import ZERO, Vec3, add, scale, subtract
from lapwing.kernels import kernel, math

_SQRT_2 = math.sqrt(2.0)


class LowPass(NamedTuple):
    """Filter between the element and the output."""

    bandwidth_hz: Annotated[float, Gt(0), Le(1e5)]  # [Hz] half-power (-3 dB) frequency
    group_delay: Annotated[float, Ge(0), Le(1)] = 0.0  # [s] of slow signals; 0: that of the Butterworth filter


class LowPassState(NamedTuple):
    """State of three equal filters."""

    output: Vec3
    slope: Vec3  # derivative of the output over the pole's frequency
    delayed: Vec3  # input of the Butterworth filter at the last sample
    raw: Vec3  # undelayed input at the last sample


REST = LowPassState(ZERO, ZERO, ZERO, ZERO)


@kernel
def butterworth_delay(f: LowPass) -> float:
    """Return the group delay [s] of the Butterworth filter for slow signals."""
    return _SQRT_2 / (2.0 * math.pi * f.bandwidth_hz)


@kernel
def additional_delay(f: LowPass) -> float:
    """Return the delay [s] in addition to that of the Butterworth filter."""
    return max(f.group_delay - butterworth_delay(f), 0.0)


def check_low_pass(f: LowPass | None, rate: float) -> None:
    """Raise ConfigError if the delay is shorter than the bandwidth allows, or its excess is longer than a sample."""
    if f is None or f.group_delay == 0.0:
        return
    least = _SQRT_2 / (2.0 * math.pi * f.bandwidth_hz)
    if f.group_delay < 0.999 * least or f.group_delay - least > 1.0 / rate:
        message = (
            f"from {least:.3g} s (bandwidth) to {least + 1.0 / rate:.3g} s; use latency_samples for a longer delay"
        )
        raise ConfigError("group_delay", f"got {f.group_delay:g}", message)


@kernel
def state_at_rest(value: Vec3) -> LowPassState:
    """Return the state of a filter at rest with this input."""
    return LowPassState(value, ZERO, value, value)


@kernel
def update(f: LowPass, s: LowPassState, rate: float, value: Vec3) -> LowPassState:
    """Return the state one sample later, exact for an input that is linear in between."""
    delayed = subtract(value, scale(additional_delay(f) * rate, subtract(value, s.raw)))
    beta = 2.0 * math.pi * f.bandwidth_hz / _SQRT_2  # [rad/s] real and imaginary part of the poles
    decay = math.exp(-beta / rate)
    sine, cosine = math.sincos(beta / rate)
    change = subtract(delayed, s.delayed)
    lag, slope = scale(butterworth_delay(f) * rate, change), scale(rate / beta, change)
    e, v = add(subtract(s.output, s.delayed), lag), subtract(s.slope, slope)
    output = add(subtract(delayed, lag), scale(decay, add(scale(cosine + sine, e), scale(sine, v))))
    slope_after = add(slope, scale(decay, subtract(scale(cosine - sine, v), scale(2.0 * sine, e))))
    return LowPassState(output, slope_after, delayed, value)


@kernel
def response(f: LowPass, omega: float) -> tuple[float, float]:
    """Return gain and phase [rad] at a frequency [rad/s]."""
    u = omega / (2.0 * math.pi * f.bandwidth_hz)
    gain = 1.0 / math.sqrt(1.0 + u * u * u * u)
    return gain, -math.atan2(_SQRT_2 * u, 1.0 - u * u) - omega * additional_delay(f)
