"""Conversion of a true distance into a reading of a sonar or rangefinder (theory, section 3.2)."""

import math
from typing import Any, NamedTuple

from lapwing.dynamics.noise import TURN_ON, Key, normal
from lapwing.kernels import always_inline
from lapwing.services.common.ports import DistanceReading
from lapwing.services.sensors import error_models
from lapwing.services.sensors.delay_line import BLANK, Line, apply_delay_and_faults, new_delay_line

CHANNELS = ("range",)
FARTHEST = 1000.0  # [m] maximum length of a ray


class DistanceState(NamedTuple):
    """State of a distance sensor."""

    scale: float
    line: Line  # only the first component is used


def blank() -> DistanceState:
    """Return a placeholder state, replaced at the first tick."""
    return DistanceState(0.0, BLANK)


@always_inline
def initial_state(p: Any, key: Key, distance: float) -> DistanceState:
    """Return the state before the first sample, at a true distance [m]; `p`: parameters of the sensor."""
    return DistanceState(1.0 + p.scale_error * normal(key, TURN_ON, 0), new_delay_line((distance, 0.0, 0.0)))


@always_inline
def measure(p: Any, s: DistanceState, key: Key, tick: int, distance: float) -> tuple[DistanceState, DistanceReading]:
    """Return the next state and the reading of a true distance [m]. See `imu.sample` for other arguments."""
    noise = error_models.white_deviation(p.noise_m_per_sqrt_hz, p.rate) * normal(key, tick, 0)
    true = (s.scale * distance + noise, 0.0, 0.0)
    line, delayed, valid = apply_delay_and_faults(p.faults, s.line, p.latency_samples, 0, key, tick, true)
    result = error_models.quantise(delayed[0], p.resolution)
    if result > p.range_max:
        result = math.inf
    elif result < p.range_min:
        result = -math.inf
    variance = error_models.sample_variance(p.noise_m_per_sqrt_hz, p.resolution, p.rate)
    return DistanceState(s.scale, line), DistanceReading(result, variance, valid)
