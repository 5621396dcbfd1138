"""The formation's control as a service: every body's state in, thrusts and moments out."""

from cosim.graph import Service
from cosim.part import Part
from cosim.setup import Setup
from dynamics.cell import Cell
from services.formation.wire import wires

NAME = "formation"


def create(setup: Setup) -> Service:
    """The control of a run."""
    given = setup.services[NAME]
    return Service(NAME, [Part(NAME, given.parameters, Cell(0.0), given.inputs, given.ports)], wires(setup))
