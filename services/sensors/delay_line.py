"""Output stage of an instrument: latency in whole samples, and scheduled faults.

A faulty instrument still outputs readings; lost ones have `valid = False`.
"""

from typing import NamedTuple

from lapwing.dynamics.noise import Key, normal3, uniform
from lapwing.dynamics.vector import ZERO, Vec3, add, multiply, scale
from lapwing.kernels import always_inline, kernel

DEPTH = 16  # [samples] length of a delay line
Line = tuple[Vec3, ...]  # the last DEPTH values, newest first

BLANK: Line = (ZERO,) * DEPTH

KINDS = ("none", "dropout", "freeze", "bias", "spikes", "drift", "scale", "delay")
NONE, DROPOUT, FREEZE, BIAS, SPIKES, DRIFT, SCALE, DELAY = range(len(KINDS))
ALL_CHANNELS = -1
_SPIKE_LANE = 100  # lane of the spikes' random numbers, above those of the instruments


class Fault(NamedTuple):
    """Compiled fault."""

    kind: int = NONE  # index into KINDS
    channel: int = ALL_CHANNELS
    start: int = 0  # [tick]
    stop: int = 0  # [tick] exclusive
    size: Vec3 = ZERO  # bias and spikes: unit of the channel; drift: that per tick; scale: factor
    probability: float = 0.0  # of a spike, per sample
    samples: int = 0  # [samples] delay in addition to the latency


@always_inline
def new_delay_line(value: Vec3) -> Line:
    """Return a delay line filled with `value`."""
    four = (value, value, value, value)
    return four + four + four + four  # DEPTH of them; compiled tuples have no `*`


@always_inline
def _push(line: Line, value: Vec3) -> Line:
    return (value,) + line[:-1]  # noqa: RUF005 (compiled tuples have no unpacking)


@kernel
def apply_delay_and_faults(
    faults: tuple[Fault, ...] | None, line: Line, latency: int, channel: int, key: Key, tick: int, value: Vec3
) -> tuple[Line, Vec3, bool]:
    """Return the output of a channel's delay line after a new value.

    Args:
        faults: tuple of `Fault`, or None (compiled away).
        line: the channel's `Line`.
        latency: [samples], less than DEPTH.
        channel: index of the channel in the instrument's `CHANNELS`.
        key: key of the instrument's random stream.
        tick: present tick.
        value: measured value of this tick.

    Returns:
        The new delay line, the delayed value, and False if the reading is lost.
    """
    if faults is None:
        line = _push(line, value)
        return line, line[latency], True
    age = latency
    valid = True
    frozen = False
    for i in range(len(faults)):
        f = faults[i]
        if not (f.start <= tick < f.stop and (f.channel == channel or f.channel == ALL_CHANNELS)):
            continue
        if f.kind == DROPOUT:
            valid = False
        elif f.kind == FREEZE:
            frozen = True
        elif f.kind == BIAS:
            value = add(value, f.size)
        elif f.kind == SPIKES:
            if uniform(key, tick, _SPIKE_LANE + 2 * (8 * i + channel)) < f.probability:
                value = add(value, multiply(f.size, normal3(key, tick, _SPIKE_LANE + 2 * (8 * i + channel) + 1)))
        elif f.kind == DRIFT:
            value = add(value, scale(float(tick - f.start), f.size))
        elif f.kind == SCALE:
            value = multiply(value, f.size)
        elif f.kind == DELAY:
            age = min(age + f.samples, DEPTH - 1)
    if not frozen:
        line = _push(line, value)
    return line, line[age], valid
