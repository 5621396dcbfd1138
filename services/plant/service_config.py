"""Resolved configuration of the plant: block, initial state, message contents."""

from typing import Any, NamedTuple

from lapwing.dynamics.effects._vehicle_interaction import NeighbourState
from lapwing.services.plant.encoders import PlantEncoding


class PlantEvent(NamedTuple):
    """Failure of a propeller in flight, in the communication step from `tick` on."""

    tick: int
    propeller: int  # from 0, in the order of the airframe
    becomes: str  # "locked", "free" or "torn_off"
    time: float = 0.0  # [s]; a time before `tick` is that of the tick


class FleetCoupling(NamedTuple):
    """Fleet data of a plant's effects."""

    ports: tuple[str, ...]  # neighbour-state ports that it reads, including that of a load
    presence: NeighbourState  # prototype of its own neighbour state, with the constant fields
    load: Any = None  # parameters of the load that this plant integrates, or None
    load_start: Any = None  # its state at tick 0
    load_inputs: tuple[str, ...] = ()  # neighbour-state ports of its carriers


class PlantConfig(NamedTuple):
    """Configuration of a plant."""

    model: str  # name of the plant model
    core: Any  # parameters of a block of services/plant/blocks
    start: Any  # state at tick 0
    encoding: PlantEncoding
    bodies: Any = None  # parameters of the block that publishes body states, or None
    events: tuple[PlantEvent, ...] = ()
    euler: bool = False  # five bodies in Euler angles, singular at a pitch of 90 degrees
    others: FleetCoupling | None = None
    contact: Any = None  # parameters of the block that publishes contact forces, or None
