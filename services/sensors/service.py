"""Sensor service: computes the readings of each instrument from the true state."""

import sys

from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.diagram.block_diagram import Service
from lapwing.cosim.diagram.compiled_block import Block
from lapwing.cosim.diagram.topic_encoder import TopicEncoder
from lapwing.kernels.cell import Cell
from lapwing.services.common import ports
from lapwing.services.common.encoders import reading_encoder
from lapwing.services.sensors.block import Instrument
from lapwing.services.sensors.encoders import PORTS, topic_encoders

NAME = "sensors"


def create(config: RunConfig) -> Service:
    """Return the sensors of a run, whose parameters are its instruments in the order of their ports."""
    settings = config.services[NAME]
    instruments: tuple[Instrument, ...] = settings.parameters
    blocks: list[Block] = []
    encoders: list[TopicEncoder] = []
    for p, port in zip(instruments, settings.ports, strict=True):
        module, inputs = sys.modules[type(p.sensor).__module__], settings.inputs[: 1 + len(p.others)]
        blocks.append(Block(f"{NAME}.{port.name}", p, Cell(module.blank()), inputs, (port,), port.period))
        if port.name not in PORTS:
            built_in = module.__package__ == __package__ and port.name not in ports.IMUS
            encoders += (
                module.topic_encoders(config.vehicle, port, p) if built_in else [reading_encoder(config.vehicle, port)]
            )
    sensors = {port.name: p.sensor for p, port in zip(instruments, settings.ports, strict=True)}
    return Service(NAME, blocks, encoders + topic_encoders(config, sensors))
