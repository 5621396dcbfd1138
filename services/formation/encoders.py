"""What the formation's control gives, as messages."""

from typing import Any

import numpy as np

from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.diagram.topic_encoder import Fields, TopicEncoder
from lapwing.messages import LiftCommand, Vector3, header
from lapwing.messages import topics as topic
from lapwing.messages.cdr_arrays import stamp_columns
from lapwing.services.common import ports
from lapwing.services.common.ports import RotorWrenches


def wires(setup: RunConfig) -> list[TopicEncoder]:
    """The thrusts and moments of the quadrotors."""
    n = len(setup.port(ports.LIFT).like.thrust)
    sample = LiftCommand(header(0, "body"), (0.0,) * n, (Vector3(),) * n)
    return [TopicEncoder(topic.LIFT, ports.LIFT, 1, _lift, lambda: sample)]


def _lift(x: RotorWrenches, time_ns: np.ndarray) -> Fields:
    found: dict[str, Any] = {**stamp_columns(time_ns), "thrust": x.thrust}
    for i, moment in enumerate(x.moment_body):
        found[f"moment.{i}"] = moment
    return found
