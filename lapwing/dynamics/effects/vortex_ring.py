"""Vortex ring state: loss and fluctuation of the thrust in descent."""

import zlib
from typing import Annotated, NamedTuple

from annotated_types import Ge, Le

from lapwing.dynamics.effects._axes import hub_speeds
from lapwing.dynamics.effects._from_scene import Airframe, reject, validate_table
from lapwing.dynamics.effects._hooks import discrete_update, load_factors
from lapwing.dynamics.effects._types import Factors
from lapwing.dynamics.noise import normal3
from lapwing.dynamics.vector import pair, product
from lapwing.dynamics.vehicles.propeller import hover_flow
from lapwing.kernels import always_inline, math
from lapwing.kernels.codegen import map_tuple

LANE = zlib.crc32(b"vortex_ring")
# descent over the induced velocity in hover where the ring begins, is strongest, and ends (windmill brake state)
BEGINS, STRONGEST, ENDS = 0.4, 1.25, 2.0
SHORTEST, LONGEST = 20.0, 50.0  # revolutions between two shed rings
# over the rotor's speed: rate of the oscillation, and of the decay of its correlation
TURNING = 1.0 / math.sqrt(SHORTEST * LONGEST)
FADING = 0.25 * (1.0 / SHORTEST - 1.0 / LONGEST)
SLOWEST = 1e-3  # [m/s] lower limit of the induced velocity in ratios


class Settings(NamedTuple):
    """Scene table."""

    loss: Annotated[float, Ge(0), Le(0.6)] = 0.2  # share of the mean thrust that is lost in the strongest ring
    unsteadiness: Annotated[float, Ge(0), Le(0.4)] = 0.13  # share of the thrust, standard deviation in the ring


class VortexRing(NamedTuple):
    """Factor on the thrust of each rotor in descent with a mean loss and a random oscillation (theory, eq. (2.71),
    (2.72)).

    Sources: losses and fluctuations are largest at 1.2 to 1.3 times the induced velocity in hover: Veismann, Dougherty
    and Gharib, Flow 3 (2023) E7; fluctuations of up to 95 % of the mean from peak to peak, every 20 to 50 revolutions:
    Stack, Caradonna and Savas, J. American Helicopter Society 50 (2005). The size of the mean loss is chosen. Valid for
    descent along the rotors' axes; a transverse wind as fast as the induced velocity in hover removes the ring. The
    loss applies to the mean thrust of `dynamic_inflow`. Sampled exactly once per communication step.
    """

    flow: float  # [m/rad] induced velocity in hover over the rotor's speed
    loss: float
    unsteadiness: float
    lanes: tuple[int, ...]  # of the random numbers of each rotor
    calm: tuple[tuple[float, float], ...]  # zeros for each rotor

    @classmethod
    def from_scene(cls, table: dict, airframe: Airframe) -> "VortexRing":
        """Return the parameters of the airframe's propeller."""
        settings = validate_table(Settings, table)
        propeller = airframe.propeller or reject("the vehicle has no [propeller]")
        count = len(airframe.rotors.position)
        lanes = tuple(LANE + k for k in range(count))
        return cls(hover_flow(propeller), settings.loss, settings.unsteadiness, lanes, ((0.0, 0.0),) * count)

    def initial_discrete_state(self) -> tuple[tuple[float, float], ...]:
        """Return the oscillation of each rotor, in phase and in quadrature; its stationary deviation is 1."""
        return self.calm


@always_inline
def strength(descent, across):
    """Return the strength of the ring, 1 at most.

    Args:
        descent: air speed along the axis with the rotor's flow, over the induced velocity in hover.
        across: air speed across the axis, over the same.
    """
    up = min(max((descent - BEGINS) * (1.0 / (STRONGEST - BEGINS)), 0.0), 1.0)
    down = min(max((ENDS - descent) * (1.0 / (ENDS - STRONGEST)), 0.0), 1.0)
    return up * up * (3.0 - 2.0 * up) * (down * down * (3.0 - 2.0 * down)) * max(1.0 - across, 0.0)


@always_inline
def _advance_oscillation(c, state, both):
    """Return the oscillation of a rotor an interval later."""
    key, tick, interval = c
    speed, lane = both
    angle = speed * interval
    decay, drawn = math.exp(-FADING * angle), normal3(key, tick, lane)
    fresh = math.sqrt(1.0 - decay * decay)
    sine, cosine = math.sincos(TURNING * angle)
    a, b = state
    return decay * (cosine * a - sine * b) + fresh * drawn[0], decay * (sine * a + cosine * b) + fresh * drawn[1]


@discrete_update(VortexRing)
def oscillate(e, memory, s, rotors, key, tick, interval):
    """Return the oscillation of each rotor for the next interval."""
    return map_tuple(
        _advance_oscillation, (key, tick, interval), memory, map_tuple(pair, 0.0, s.motion.rotor_speed, e.lanes)
    )


@always_inline
def _factor(e, hub, both):
    speed, state = both
    hover = max(e.flow * speed, SLOWEST)
    return 1.0 - strength(-hub[0] / hover, hub[1] / hover) * (e.loss + e.unsteadiness * state[0])


@load_factors(VortexRing)
def vortex_ring(e, memory, s, before):
    """Multiply the thrust factors; torque is unchanged."""
    factor = map_tuple(_factor, e, hub_speeds(s), map_tuple(pair, 0.0, s.motion.rotor_speed, memory))
    return Factors(map_tuple(product, 0.0, before.thrust, factor), before.torque)
