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

NAME = "trajectory"


class TrajectorySetup(NamedTuple):
    """What the service is given."""

    core: TrajectoryPath
    phases: tuple[str, ...]  # names, by number


def create(setup: Setup) -> Service:
    """The signal builder of a run."""
    given: Any = setup.services[NAME]
    part = Part(NAME, given.parameters.core, Cell(0.0), given.inputs, given.ports)
    return Service(NAME, [part], [reference_wire(TRAJECTORY, ports.TRAJECTORY, given.parameters.phases)])
