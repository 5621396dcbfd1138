"""Trajectory service: outputs setpoints, up to a bounded time ahead of the plant."""

from typing import Any, NamedTuple

from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.diagram.block_diagram import Service
from lapwing.cosim.diagram.compiled_block import Block
from lapwing.kernels.cell import Cell
from lapwing.messages.topics import TRAJECTORY
from lapwing.services.common import ports
from lapwing.services.common.encoders import setpoint_encoder
from lapwing.services.trajectory.block import TrajectoryPath
from lapwing.services.trajectory.leader_follower import FollowedPath

NAME = "trajectory"


class TrajectoryConfig(NamedTuple):
    """Parameters of the service's block, and names for its messages."""

    core: TrajectoryPath | FollowedPath
    phases: tuple[str, ...]  # names by index


def create(config: RunConfig) -> Service:
    """Return the trajectory service of a run."""
    settings: Any = config.services[NAME]
    block = Block(NAME, settings.parameters.core, Cell(0.0), settings.inputs, settings.ports)
    return Service(NAME, [block], [setpoint_encoder(TRAJECTORY, ports.TRAJECTORY, settings.parameters.phases)])
