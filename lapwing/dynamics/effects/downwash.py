"""Downwash of the vehicles of a fleet on vehicles below."""

from typing import Annotated, NamedTuple

from annotated_types import Ge, Le

from lapwing.dynamics.effects._from_scene import Airframe, reject, validate_table
from lapwing.dynamics.effects._hooks import air
from lapwing.dynamics.effects._types import Air
from lapwing.dynamics.effects._vehicle_interaction import interaction
from lapwing.dynamics.vector import ZERO, add, dot, norm, scale, subtract
from lapwing.kernels import math


class Settings(NamedTuple):
    """Scene table."""

    spread: Annotated[float, Ge(0), Le(1)] = 0.113  # growth of the jet's 1/e radius per distance
    core: Annotated[float, Ge(0), Le(20)] = 0.0  # distance before the jet spreads, over that of opposite rotors


class Downwash(NamedTuple):
    """Wind in the jet of each other vehicle that has this effect (theory, eq. (2.62) to (2.64)).

    All rotors of a vehicle form one jet, opposite to their thrust. The developed jet has twice the induced velocity of
    momentum theory, a Gaussian profile whose width grows with the distance, and the momentum of the thrust. It acts
    through the effects that use the air velocity (body_drag, axial_inflow, dynamic_inflow). Source: Leishman,
    Principles of Helicopter Aerodynamics, on the wake in hover; Pope, Turbulent Flows, section 5.1, on the round jet,
    whose half width grows by 0.094 m per metre; Bauersfeld et al., IEEE Robotics and Automation Letters 10 (2025), who
    measured a jet from 2.5 distances of opposite rotors below a quadrotor on (`core`). Valid near hover, below by more
    than the distance between rotors, where their jets have merged; wind and ground do not deflect the jet, and it has
    no delay.
    """

    disc_radius: float  # [m] radius of a disc with the area of all rotors
    spread: float
    core: float  # [m] distance before the jet spreads

    @classmethod
    def from_scene(cls, table: dict, airframe: Airframe) -> "Downwash":
        """Return the parameters with the discs of the airframe's propellers."""
        settings = validate_table(Settings, table)
        propeller = airframe.propeller or reject("the vehicle has no [propeller]")
        places = airframe.rotors.position
        opposite = 2.0 * max(math.hypot(x, y) for x, y, _ in places)
        return cls(0.5 * propeller.diameter * math.sqrt(len(places)), settings.spread, settings.core * opposite)

    def initial_discrete_state(self) -> tuple[float, float, float]:
        """Return the wind of others [m/s], world."""
        return ZERO

    def presence(self) -> dict[str, float]:
        """Return the origin of its jet."""
        return {"disc_radius": self.disc_radius}


@interaction(Downwash)
def wind_of_jets(e, memory, own, others, interval):
    """Return the wind of all other vehicles' jets at this vehicle, for the coming interval."""
    wind = (0.0, 0.0, 0.0)
    for other in others:
        thrust, R = norm(other.thrust_world), other.disc_radius
        if thrust == 0.0 or R == 0.0:
            continue
        down = scale(-1.0 / thrust, other.thrust_world)
        away = subtract(own.position_world, other.position_world)
        along = dot(away, down)
        across = subtract(away, scale(along, down))
        width = R + e.spread * max(along - e.core, 0.0)
        induced = math.sqrt(thrust / (2.0 * math.pi * other.air_density)) / R
        developed = 1.0 + along / math.sqrt(along * along + R * R)
        speed = induced * developed * R / width * math.exp(-dot(across, across) / (width * width))
        wind = add(wind, scale(speed, down))
    return wind


@air(Downwash)
def downwash(e, memory, s, before):
    """Add the wind of the other vehicles to the air."""
    return Air(before.density, add(before.wind_world, memory))
