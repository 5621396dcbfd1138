"""The trajectory as a service: the reference of every tick, a bounded time ahead of the plant."""

from typing import Any, NamedTuple

from cosim.graph import Service
from cosim.part import Part
from cosim.setup import Setup
from dynamics.cell import Cell
from messages.topics import TRAJECTORY
from services.common import ports
from services.common.references import reference_wire
from services.trajectory.core import TrajectoryPath
from services.trajectory.following import FollowedPath

NAME = "trajectory"


class TrajectorySetup(NamedTuple):
    """What the service is given."""

    core: TrajectoryPath | FollowedPath
    phases: tuple[str, ...]  # names, by number
    follow: str = ""  # name of the vehicle relative to whose trajectory it is
    heading: bool = False  # whether its axes turn with that one


def create(setup: Setup) -> Service:
    """The signal builder of a run."""
    given: Any = setup.services[NAME]
    part = Part(NAME, given.parameters.core, Cell(0.0), given.inputs, given.ports)
    return Service(NAME, [part], [reference_wire(TRAJECTORY, ports.TRAJECTORY, given.parameters.phases)])
