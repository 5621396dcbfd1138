"""The sensors as a service: the true state in, what each instrument reads out."""

import sys
from typing import NamedTuple

from cosim.graph import Service
from cosim.part import Part
from cosim.setup import Setup
from dynamics.cell import Cell
from services.sensors.core import Instrument
from services.sensors.wire import SonarWiring, wires

NAME = "sensors"


class SensorsSetup(NamedTuple):
    """What the service is given."""

    instruments: tuple[Instrument, ...]  # in the order of their ports
    sonar: SonarWiring | None  # None where no sonar is carried


def create(setup: Setup) -> Service:
    """The sensors of a run."""
    given = setup.services[NAME]
    s: SensorsSetup = given.parameters
    parts = [
        Part(f"{NAME}.{port.name}", p, Cell(_blank(p)), given.inputs, (port,), port.period)
        for p, port in zip(s.instruments, given.ports, strict=True)
    ]
    return Service(NAME, parts, wires(setup, s.sonar))


def _blank(p: Instrument) -> tuple:
    return sys.modules[type(p.sensor).__module__].blank()
