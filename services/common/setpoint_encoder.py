"""Topic encoder of setpoints: the trajectory's and the autopilot's."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from lapwing import messages
from lapwing.cosim.diagram.topic_encoder import Fields, TopicEncoder
from lapwing.messages.cdr_arrays import stamp_columns
from lapwing.messages.topics import Topic
from lapwing.services.common.ports import Setpoint


def setpoint_encoder(topic: Topic, port: str, texts: Sequence[str]) -> TopicEncoder:
    """Return the encoder of a setpoint port; `texts` has the phase names by index and may grow."""

    def sample(phase: int) -> Any:
        return messages.Setpoint(messages.header(0, "world"), phase=texts[phase])

    return TopicEncoder(topic, port, 1, _fields, sample, lambda x: [x.phase])


def _fields(x: Setpoint, time_ns: np.ndarray) -> Fields:
    return {
        **stamp_columns(time_ns),
        "position": x.position_world,
        "velocity": x.velocity_world,
        "acceleration": x.acceleration_world,
        "yaw": x.yaw,
        "yaw_rate": x.yaw_rate,
        "final": x.final,
    }
