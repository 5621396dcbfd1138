"""Random gust force: the paper's wind, as a force of random size instead of a motion of the air."""

import zlib
from typing import Annotated, NamedTuple

from annotated_types import Ge, Gt, Le

from dynamics.effects._hooks import sample, wind, wrench
from dynamics.noise import normal3
from dynamics.vector import NOTHING, ZERO, Vec3, add, norm, scale, subtract

Speed = Annotated[float, Ge(-60), Le(60)]

LANE = zlib.crc32(b"wind_random")


class WindRandom(NamedTuple):
    """Force 1/2 C_s S rho |v| v at the centre of mass, of the air's speed v past the vehicle (theory.md, eq. (2.8)).

    The wind is the mean plus one normal draw for each axis and exchange interval; the force is held over the interval.
    Source: Pappalardo et al. 2023, section 6.1. Valid as a disturbance, not as turbulence (`wind_dryden`): the draws
    are independent, so that the force's spectrum is flat up to the exchange rate.
    """

    mean: tuple[Speed, Speed, Speed] = (0.0, 0.0, 0.0)  # [m/s] world
    sigma: Annotated[float, Ge(0), Le(30)] = 1.0  # [m/s] of each axis
    area: Annotated[float, Gt(0), Le(100)] = 0.06  # [m^2] S
    density: Annotated[float, Gt(0), Le(5)] = 1.22  # [kg/m^3] rho, of the air
    shape_coefficient: Annotated[float, Gt(0), Le(10)] = 1.0  # C_s

    def initial_memory(self) -> tuple[Vec3, Vec3]:
        """The force and the wind: none before the first exchange."""
        return ZERO, ZERO


@sample(WindRandom)
def draw(e, memory, s, rotors, key, tick, interval):
    """Force [N] and wind [m/s] in world coordinates for the next interval."""
    drawn = add(e.mean, scale(e.sigma, normal3(key, tick, LANE)))
    v = subtract(drawn, s.motion.velocity_world)
    return scale(0.5 * e.shape_coefficient * e.area * e.density * norm(v), v), drawn


@wrench(WindRandom)
def wind_random(e, memory, s, rotors):
    """Force [N] in world, torque [N m] in body coordinates."""
    return memory[0], NOTHING


@wind(WindRandom)
def told(e, memory, before):
    """The wind [m/s] that the force is made of, added."""
    return add(before, memory[1])
