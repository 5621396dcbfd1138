"""Formation control service: thrust [N] and moment [N m] of each vehicle that carries the load."""

from typing import Any

import numpy as np

from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.diagram.block_diagram import Service
from lapwing.cosim.diagram.compiled_block import Block
from lapwing.cosim.diagram.topic_encoder import Fields, TopicEncoder
from lapwing.kernels.cell import Cell
from lapwing.messages import RotorWrench, Vector3, header
from lapwing.messages import topics as topic
from lapwing.messages.cdr_arrays import stamp_columns
from lapwing.services.common import ports
from lapwing.services.common.ports import RotorWrenches

NAME = "formation"


def create(config: RunConfig) -> Service:
    """Return the formation control of a run."""
    settings = config.services[NAME]
    n = len(config.port(ports.LIFT).example.thrust)
    message = RotorWrench(header(0, "body"), (0.0,) * n, (Vector3(),) * n)
    encoder = TopicEncoder(topic.LIFT, ports.LIFT, 1, _lift, lambda: message)
    return Service(NAME, [Block(NAME, settings.parameters, Cell(0.0), settings.inputs, settings.ports)], [encoder])


def _lift(x: RotorWrenches, time_ns: np.ndarray) -> Fields:
    fields: dict[str, Any] = {**stamp_columns(time_ns), "thrust": x.thrust}
    for i, moment in enumerate(x.moment_body):
        fields[f"moment.{i}"] = moment
    return fields
