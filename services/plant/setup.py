"""What the plant is given: its core, its start, and what its messages say."""

from typing import Any, NamedTuple

from services.plant.wire import PlantWiring


class PlantEvent(NamedTuple):
    """What becomes of a propeller in flight, after the state of `tick` was told."""

    tick: int
    propeller: int  # from 0, in the order of the airframe
    becomes: str  # "locked", "free" or "torn_off"


class PlantSetup(NamedTuple):
    """A plant."""

    model: str  # for people
    core: Any  # parameters of a part of services/plant/cores
    start: Any  # the state at tick 0
    wiring: PlantWiring
    bodies: Any = None  # parameters of the part that tells of single bodies, None without it
    events: tuple[PlantEvent, ...] = ()
    euler: bool = False  # five bodies in Euler angles, which end where a pitch reaches 90 degrees
