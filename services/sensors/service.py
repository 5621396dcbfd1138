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


class SensorsConfig(NamedTuple):
    """Resolved configuration of the service."""

    instruments: tuple[Instrument, ...]  # in the order of their ports
    sonar: SonarEncoding | None  # None without a sonar
    gps: GpsEncoding


def create(config: RunConfig) -> Service:
    """Return the sensors of a run."""
    settings = config.services[NAME]
    s: SensorsConfig = settings.parameters
    parts = [
        Block(f"{NAME}.{port.name}", p, Cell(_blank(p)), settings.inputs[: 1 + len(p.others)], (port,), port.period)
        for p, port in zip(s.instruments, settings.ports, strict=True)
    ]
    return Service(NAME, parts, _module_encoders(config, s) + topic_encoders(config, s.sonar, s.gps))


def _module_encoders(config: RunConfig, s: SensorsConfig) -> list[TopicEncoder]:
    """Return the encoders of sensors whose modules provide them, and of custom sensors."""
    result: list[TopicEncoder] = []
    for p, port in zip(s.instruments, config.services[NAME].ports, strict=True):
        module = sys.modules[type(p.sensor).__module__]
        if port.name in PORTS:
            continue
        built_in = module.__package__ == __package__ and port.name not in ports.IMUS
        result += (
            module.topic_encoders(config.vehicle, port, p) if built_in else [reading_encoder(config.vehicle, port)]
        )
    return result


def _blank(p: Instrument) -> tuple:
    return sys.modules[type(p.sensor).__module__].blank()
