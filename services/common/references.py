"""References as messages: the trajectory's, and what the autopilot follows."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from cosim.wire import Fields, Wire
from messages import Setpoint, header
from messages.records import stamp_columns
from messages.topics import Topic
from services.common.ports import Reference


def reference_wire(topic: Topic, port: str, texts: Sequence[str]) -> Wire:
    """The topic of a port of references; `texts` names the phases by number, and may grow."""

    def sample(phase: int) -> Any:
        return Setpoint(header(0, "world"), phase=texts[phase])

    return Wire(topic, port, 1, _fields, sample, lambda x: [x.phase])


def _fields(x: Reference, time_ns: np.ndarray) -> Fields:
    return {
        **stamp_columns(time_ns),
        "position": x.position_world,
        "velocity": x.velocity_world,
        "acceleration": x.acceleration_world,
        "yaw": x.yaw,
        "yaw_rate": x.yaw_rate,
        "final": x.final,
    }
