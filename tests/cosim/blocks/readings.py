"""Block that returns a tree of every kind of number and requests statuses at given ticks."""

from typing import NamedTuple

from lapwing.cosim.diagram.compiled_block import CONTINUE, FINISHED, NON_FINITE, WAKE_PYTHON
from lapwing.dynamics.vector import Vec3
from lapwing.kernels import always_inline


class Place(NamedTuple):
    """Nested tree."""

    position: Vec3
    seen: bool


class Reading(NamedTuple):
    """Numbers of every kind."""

    number: float
    good: bool
    count: int
    places: tuple[Place, Place]
    rest: tuple[int, ...]


EXAMPLE = Reading(0.0, False, 0, (Place((0.0,) * 3, False),) * 2, (0, 0))


class Readings(NamedTuple):
    """Factor of the output, and ticks of the statuses."""

    factor: float
    look_every: int = 0  # ticks; 0: never
    end: int = -1  # tick
    failure: int = -1  # tick


def expected(factor, tick, count):
    """Return the output of the `count`th step at `tick`."""
    t = float(tick)
    near, far = Place((factor * t, -t, 0.5), tick % 2 == 0), Place((0.25, t * t, 1e-300), tick % 3 == 0)
    return Reading(factor * t, tick % 5 == 0, -count, (near, far), (count, 3 - tick))


@always_inline
def step(p, s, tick, inputs):
    """Return the output of the present tick and count."""
    n, t = s + 1, float(tick)
    near, far = Place((p.factor * t, -t, 0.5), tick % 2 == 0), Place((0.25, t * t, 1e-300), tick % 3 == 0)
    values = Reading(p.factor * t, tick % 5 == 0, -n, (near, far), (n, 3 - tick))
    signal = WAKE_PYTHON if p.look_every > 0 and tick % p.look_every == 0 else CONTINUE
    if tick == p.end:
        signal = FINISHED
    if tick == p.failure:
        signal = NON_FINITE
    return n, (values,), signal
