"""Resolved configuration of the plant: block, initial state, message contents."""

from typing import Any, NamedTuple

from lapwing.dynamics.effects._vehicle_interaction import NeighbourState
from lapwing.services.plant.encoders import PlantWiring


class PlantEvent(NamedTuple):
    """Failure of a propeller in flight, in the communication step from `tick` on."""

    tick: int
    propeller: int  # from 0, in the order of the airframe
    becomes: str  # "locked", "free" or "torn_off"
    time: float = 0.0  # [s]; a time before `tick` is that of the tick


class FleetCoupling(NamedTuple):
    """Fleet data of a plant's effects."""

    ports: tuple[str, ...]  # of the others' presence, as this vehicle calls them; that of a load among them
    presence: NeighbourState  # what these may know of its vehicle, with the numbers that do not change
    load: Any = None  # parameters of the load that this plant moves beside its vehicle, None without it
    load_start: Any = None  # its state at tick 0
    load_inputs: tuple[str, ...] = ()  # ports of its carriers' presence


class PlantSetup(NamedTuple):
    """A plant."""

    model: str  # for people
    core: Any  # parameters of a part of services/plant/cores
    start: Any  # the state at tick 0
    wiring: PlantWiring
    bodies: Any = None  # parameters of the block that publishes body states, or None
    events: tuple[PlantEvent, ...] = ()
    euler: bool = False  # five bodies in Euler angles, which end where a pitch reaches 90 degrees
    others: FleetCoupling | None = None
    contact: Any = None  # parameters of the block that publishes contact forces, or None
