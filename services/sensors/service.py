"""The sensors as a service: the true state in, what each instrument reads out."""

import sys
from typing import NamedTuple

from cosim.graph import Service
from cosim.part import Part
from cosim.setup import Setup
from cosim.wire import Wire
from dynamics.cell import Cell
from services.sensors.core import Instrument
from services.sensors.wire import PORTS, SonarWiring, own_wire, wires

NAME = "sensors"


class SensorsSetup(NamedTuple):
    """What the service is given."""

    instruments: tuple[Instrument, ...]  # in the order of their ports
    sonar: SonarWiring | None  # None where no sonar is carried
    fix: int  # NavSatStatus of a satellite receiver's fixes


def create(setup: Setup) -> Service:
    """The sensors of a run."""
    given = setup.services[NAME]
    s: SensorsSetup = given.parameters
    parts = [
        Part(f"{NAME}.{port.name}", p, Cell(_blank(p)), given.inputs, (port,), port.period)
        for p, port in zip(s.instruments, given.ports, strict=True)
    ]
    return Service(NAME, parts, _other_wires(setup, s) + wires(setup, s.sonar, s.fix))


def _other_wires(setup: Setup, s: SensorsSetup) -> list[Wire]:
    """The topics of sensors whose modules make them, and of the user's own."""
    found: list[Wire] = []
    for p, port in zip(s.instruments, setup.services[NAME].ports, strict=True):
        module = sys.modules[type(p.sensor).__module__]
        if port.name in PORTS:
            continue
        ships = module.__package__ == __package__
        found += module.wires(setup.vehicle, port, p.sensor) if ships else [own_wire(setup.vehicle, port)]
    return found


def _blank(p: Instrument) -> tuple:
    return sys.modules[type(p.sensor).__module__].blank()
