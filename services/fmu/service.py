"""The FMUs of a run as a service."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.diagram.block_diagram import Service
from lapwing.cosim.diagram.compiled_block import Block
from lapwing.cosim.diagram.tick_schedule import Port
from lapwing.cosim.diagram.topic_encoder import Fields, TopicEncoder
from lapwing.kernels.row_packing import row_width
from lapwing.messages import Reading, header
from lapwing.messages import topics as topic
from lapwing.messages.cdr_arrays import stamp_columns
from lapwing.services.common import foreign_code
from lapwing.services.fmu.block import FmuBlock
from lapwing.services.fmu.service_config import FmuSetup, replaced_port

NAME = "fmu"


def create(setup: RunConfig) -> Service:
    """Return the FMUs of a run.

    Raises:
        ValueError: foreign code is not allowed.
    """
    foreign_code.check(setup)
    config: FmuSetup = setup.services[NAME].parameters
    own = {port.name: port for port in setup.services[NAME].ports}
    blocks = []
    for fmu in config.fmus:
        names = dict.fromkeys(each.port for each in fmu.outputs)
        blocks.append(FmuBlock(fmu, {name: own.get(name) or own[replaced_port(fmu.name, name)] for name in names}))
    return Service(NAME, blocks, [_encoder(setup.vehicle, port) for port in own.values()])


def rewire(parts: Sequence[Any], setup: FmuSetup) -> list[Any]:
    """Return the blocks of another service, which read the ports of FMUs in place of the ones that they replace."""
    replaced = setup.replaced

    def rewired(part: Any) -> Any:
        if not isinstance(part, Block):
            return part
        return replace(part, inputs=tuple(i._replace(port=replaced.get(i.port, i.port)) for i in part.inputs))

    return [rewired(part) for part in parts]


def _encoder(vehicle: str, port: Port) -> TopicEncoder:
    """Return the encoder of a port: all its columns as one sequence of numbers."""
    name = port.name.replace(".", "_")
    sample = Reading(header(0, vehicle), name, (0.0,) * row_width(port.like))
    return TopicEncoder(topic.custom_sensor(name), port.name, port.period, _fields, lambda: sample)


def _fields(tree: Any, time_ns: np.ndarray) -> Fields:
    def leaves(part: Any) -> list[np.ndarray]:
        return [leaf for item in part for leaf in leaves(item)] if isinstance(part, tuple) else [part]

    return {**stamp_columns(time_ns), "values": np.column_stack(leaves(tree))}
