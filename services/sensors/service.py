"""Sensor service: computes the readings of each instrument from the true state."""

import sys
from typing import NamedTuple

from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.diagram.block_diagram import Service
from lapwing.cosim.diagram.compiled_block import Block
from lapwing.cosim.diagram.topic_encoder import TopicEncoder
from lapwing.kernels.cell import Cell
from lapwing.services.common import ports
from lapwing.services.common.encoders import reading_encoder
from lapwing.services.sensors.block import Instrument
from lapwing.services.sensors.encoders import PORTS, GpsEncoding, SonarEncoding, topic_encoders

NAME = "sensors"


class SensorsSetup(NamedTuple):
    """Resolved configuration of the service."""

    instruments: tuple[Instrument, ...]  # in the order of their ports
    sonar: SonarEncoding | None  # None without a sonar
    gps: GpsEncoding


def create(setup: RunConfig) -> Service:
    """Return the sensors of a run."""
    config = setup.services[NAME]
    s: SensorsSetup = config.parameters
    parts = [
        Block(f"{NAME}.{port.name}", p, Cell(_blank(p)), config.inputs[: 1 + len(p.others)], (port,), port.period)
        for p, port in zip(s.instruments, config.ports, strict=True)
    ]
    return Service(NAME, parts, _module_encoders(setup, s) + topic_encoders(setup, s.sonar, s.gps))


def _module_encoders(setup: RunConfig, s: SensorsSetup) -> list[TopicEncoder]:
    """Return the encoders of sensors whose modules provide them, and of custom sensors."""
    result: list[TopicEncoder] = []
    for p, port in zip(s.instruments, setup.services[NAME].ports, strict=True):
        module = sys.modules[type(p.sensor).__module__]
        if port.name in PORTS:
            continue
        built_in = module.__package__ == __package__ and port.name not in ports.IMUS
        result += module.topic_encoders(setup.vehicle, port, p) if built_in else [reading_encoder(setup.vehicle, port)]
    return result


def _blank(p: Instrument) -> tuple:
    return sys.modules[type(p.sensor).__module__].blank()
