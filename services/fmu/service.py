"""Service of the lock step that steps an FMU in a process of its own."""

from typing import Any

import numpy as np

from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.diagram.block_diagram import Service
from lapwing.cosim.diagram.tick_schedule import Port
from lapwing.cosim.diagram.topic_encoder import Fields, TopicEncoder
from lapwing.kernels.row_packing import row_width
from lapwing.messages import Reading, header
from lapwing.messages import topics as topic
from lapwing.messages.cdr_arrays import stamp_columns
from lapwing.services.common import foreign_code
from lapwing.services.fmu.block import FmuBlock
from lapwing.services.fmu.service_config import FmuConfig, replaced_port


def create(setup: RunConfig, name: str) -> Service:
    """Return the service of an FMU.

    Args:
        setup: run configuration.
        name: name of the service, such as "motor_fmu" for `[services.motor]`.

    Raises:
        ValueError: foreign code is not allowed (`--allow-code`).
    """
    foreign_code.check(setup)
    fmu: FmuConfig = setup.services[name].parameters
    own = {port.name: port for port in setup.services[name].ports}
    ports = dict.fromkeys(each.port for each in fmu.outputs)
    block = FmuBlock(fmu, {port: own.get(port) or own[replaced_port(fmu.name, port)] for port in ports})
    return Service(name, [block], [_encoder(setup.vehicle, port) for port in own.values()])


def _encoder(vehicle: str, port: Port) -> TopicEncoder:
    """Return the encoder of a port: all its columns as one sequence of numbers."""
    name = port.name.replace(".", "_")
    sample = Reading(header(0, vehicle), name, (0.0,) * row_width(port.like))
    return TopicEncoder(topic.custom_sensor(name), port.name, port.period, _fields, lambda: sample)


def _fields(tree: Any, time_ns: np.ndarray) -> Fields:
    def leaves(part: Any) -> list[np.ndarray]:
        return [leaf for item in part for leaf in leaves(item)] if isinstance(part, tuple) else [part]

    return {**stamp_columns(time_ns), "values": np.column_stack(leaves(tree))}
