"""Random force on the vehicle: the wind model of the paper, without a motion of the air."""

import math
import zlib
from collections.abc import Mapping
from typing import Annotated, NamedTuple

from annotated_types import Ge, Gt, Le

from lapwing.dynamics.config_error import ConfigError
from lapwing.dynamics.effects._from_scene import Airframe, validate_table
from lapwing.dynamics.effects._hooks import discrete_update, wind, wrench
from lapwing.dynamics.noise import normal3
from lapwing.dynamics.vector import NOTHING, ZERO, Vec3, add, norm, scale, subtract
from lapwing.kernels import always_inline

Speed = Annotated[float, Ge(-60), Le(60)]

LANE = zlib.crc32(b"wind_random")  # keeps the random numbers of earlier versions
ROUNDING = 1e-6  # of an interval


class Settings(NamedTuple):
    """Scene table."""

    mean: tuple[Speed, Speed, Speed] = (0.0, 0.0, 0.0)  # [m/s] world
    sigma: Annotated[float, Ge(0), Le(30)] = 1.0  # [m/s] of each axis
    area: Annotated[float, Gt(0), Le(100)] = 0.06  # [m^2] S
    density: Annotated[float, Gt(0), Le(5)] = 1.22  # [kg/m^3] rho, of the air
    shape_coefficient: Annotated[float, Gt(0), Le(10)] = 1.0  # C_s
    interval: Annotated[float, Ge(1e-4), Le(10)] = 0.004  # [s] between two draws, whatever the communication step
    allow_body_drag: bool = False  # whether body_drag may act as well, though both are drag in this wind


class RandomWindForce(NamedTuple):
    """Random force 1/2 C_s S rho |v| v at the centre of mass for a relative wind v (theory, eq. (2.8)).

    Other effects see still air.

    The wind is the mean plus one normal draw per axis and interval. The force of a draw is that at the velocity at its
    start, so it does not depend on a communication step that divides the interval; over a longer one it is held at its
    mean. Source: Pappalardo et al. 2023, section 6.1. Valid as a disturbance, not as turbulence (`wind_dryden`):
    the draws are independent, so the wind's spectrum is flat (sigma^2 times the interval) up to the interval's
    frequency. The force includes drag, so `body_drag` is rejected in the same scene.
    """

    mean: Vec3  # [m/s] world
    sigma: float  # [m/s] of each axis
    factor: float  # [N s^2/m^2] 1/2 C_s S rho
    interval: float  # [s] between two draws

    @classmethod
    def from_scene(cls, table: dict, airframe: Airframe) -> "RandomWindForce":
        """Return the parameters of a scene's table."""
        settings = validate_table(Settings, table)
        return cls(
            settings.mean,
            settings.sigma,
            0.5 * settings.shape_coefficient * settings.area * settings.density,
            settings.interval,
        )

    def initial_discrete_state(self) -> tuple[Vec3, Vec3]:
        """Return zero force and wind, before the first tick."""
        return ZERO, ZERO


def check(table: Mapping, tables: Mapping) -> None:
    """Raise ConfigError in combination with `body_drag`, unless the table allows it."""
    if "body_drag" in tables and not table.get("allow_body_drag"):
        message = "includes drag, which effects.body_drag would count twice"
        expected = "wind_constant or wind_dryden with body_drag, or allow_body_drag = true"
        raise ConfigError("", message, expected)


@always_inline
def _blow(e, key, number, velocity_world):
    """Return (force [N], wind [m/s]) of one draw, world."""
    drawn = add(e.mean, scale(e.sigma, normal3(key, number, LANE)))
    v = subtract(drawn, velocity_world)
    return scale(e.factor * norm(v), v), drawn


@discrete_update(RandomWindForce)
def draw(e, memory, s, rotors, key, tick, interval):
    """Return the mean force [N] and wind [m/s] of the next communication step, in world coordinates."""
    start, end = tick * interval / e.interval, (tick + 1) * interval / e.interval  # in draws
    first, last = math.floor(start + ROUNDING), math.ceil(end - ROUNDING) - 1
    if first >= last:
        if tick > 0 and math.floor((tick - 1) * interval / e.interval + ROUNDING) == first:
            return memory
        return _blow(e, key, first, s.motion.velocity_world)
    force, drawn = ZERO, ZERO
    for number in range(first, last + 1):
        part = (min(end, number + 1.0) - max(start, 1.0 * number)) / (end - start)
        one = _blow(e, key, number, s.motion.velocity_world)
        force, drawn = add(force, scale(part, one[0])), add(drawn, scale(part, one[1]))
    return force, drawn


@wrench(RandomWindForce)
def random_wind_force(e, memory, s, rotors):
    """Return the force [N] in world, torque [N m] in body coordinates."""
    return memory[0], NOTHING


@wind(RandomWindForce)
def reported_wind(e, memory, before):
    """Add the wind [m/s] that causes the force to the air."""
    return add(before, memory[1])
