"""The formation's control as a service: every body's state in, thrusts and moments out."""

from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.diagram.block_diagram import Service
from lapwing.cosim.diagram.compiled_block import Block
from lapwing.kernels.cell import Cell
from lapwing.services.formation.encoders import wires

NAME = "formation"


def create(setup: RunConfig) -> Service:
    """The control of a run."""
    given = setup.services[NAME]
    return Service(NAME, [Block(NAME, given.parameters, Cell(0.0), given.inputs, given.ports)], wires(setup))
