"""Single discrete gust."""

from typing import Annotated, NamedTuple

from annotated_types import Ge, Gt, Le

from lapwing.dynamics.effects._hooks import air, break_time
from lapwing.dynamics.effects._types import Air
from lapwing.dynamics.vector import add, scale
from lapwing.kernels import math

Speed = Annotated[float, Ge(-60), Le(60)]


class WindGust(NamedTuple):
    """Gust with a one-minus-cosine profile (theory, eq. (2.19)).

    Source: the discrete gust of CS-25.341, in time instead of distance; its first half is that of MIL-F-8785C. Valid
    for vehicles much smaller than the gust.
    """

    peak: tuple[Speed, Speed, Speed]  # [m/s] world
    start: Annotated[float, Ge(0)]  # [s] simulation time
    duration: Annotated[float, Gt(0)]  # [s] of 1 - cosine, with the peak in its middle


FEWEST = 16.0  # steps in a gust


@break_time(WindGust)
def edges(e, memory, t, h, value):
    """Return the next edge of the gust; for a gust shorter than a few steps, the next edge of its parts."""
    parts = FEWEST if e.duration < FEWEST * h else 1.0
    part = e.duration / parts
    number = max(math.floor((t - e.start) / part) + 1.0, 0.0)
    return min(value, e.start + number * part) if number <= parts else value


@air(WindGust)
def wind_gust(e, memory, s, before):
    """Add the gust to the air."""
    since = s.t - e.start
    if since <= 0.0 or since >= e.duration:
        return before
    part = 0.5 * (1.0 - math.cos(2.0 * math.pi * since / e.duration))
    return Air(before.density, add(before.wind_world, scale(part, e.peak)))
