"""What the formation's control gives, as messages."""

from typing import Any

import numpy as np

from cosim.setup import Setup
from cosim.wire import Fields, Wire
from messages import LiftCommand, Vector3, header
from messages import topics as topic
from messages.records import stamp_columns
from services.common import ports
from services.common.ports import RotorWrenches


def wires(setup: Setup) -> list[Wire]:
    """The thrusts and moments of the quadrotors."""
    n = len(setup.port(ports.LIFT).like.thrust)
    sample = LiftCommand(header(0, "body"), (0.0,) * n, (Vector3(),) * n)
    return [Wire(topic.LIFT, ports.LIFT, 1, _lift, lambda: sample)]


def _lift(x: RotorWrenches, time_ns: np.ndarray) -> Fields:
    found: dict[str, Any] = {**stamp_columns(time_ns), "thrust": x.thrust}
    for i, moment in enumerate(x.moment_body):
        found[f"moment.{i}"] = moment
    return found
