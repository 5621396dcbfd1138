"""Trajectory service: outputs setpoints, up to a bounded time ahead of the plant."""

from collections.abc import Iterator
from itertools import pairwise
from typing import Any, NamedTuple

from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.diagram.block_diagram import Service
from lapwing.cosim.diagram.compiled_block import Block
from lapwing.kernels import math, python_function
from lapwing.kernels.cell import Cell
from lapwing.messages.topics import TRAJECTORY
from lapwing.services.common import ports
from lapwing.services.common.encoders import setpoint_encoder
from lapwing.services.trajectory import polynomial_piece
from lapwing.services.trajectory.block import TrajectoryPath
from lapwing.services.trajectory.leader_follower import FollowedPath
from lapwing.services.trajectory.polynomial_piece import Parameters

NAME = "trajectory"
TRACK_INTERVAL = 0.02  # [s]
_channel_at = python_function(polynomial_piece.channel_at)
_last_not_after = python_function(polynomial_piece.last_not_after)


class TrajectoryConfig(NamedTuple):
    """Parameters of the service's block, and names for its messages."""

    core: TrajectoryPath | FollowedPath
    phases: tuple[str, ...]  # names by index

    def track(self, duration: float, most: float = math.inf) -> Iterator[tuple[float, str, float, float, float]]:
        """Yield time [s], phase and world x, y, z [m], until the vehicle holds or `duration` [s] is over.

        Args:
            duration: of the run [s].
            most: largest number of intervals between the places; each takes at least `TRACK_INTERVAL`.
        """
        core = self.core
        paths = [core.relative.path, core.leader.path] if isinstance(core, FollowedPath) else [core.path]
        own = paths[0]
        duration = min(duration, max(float(c.start[-1]) for path in paths for c in (path.x, path.y, path.yaw)))
        interval = max(TRACK_INTERVAL, duration / most)
        for sample in range(int(duration / interval) + 2):
            time = min(sample * interval, duration)
            x, y, z = _place(own, time)
            if isinstance(core, FollowedPath):
                s, c = math.sincos(_channel_at(core.leader.path.yaw, time)[0]) if core.heading else (0.0, 1.0)
                x0, y0, z0 = _place(core.leader.path, time)
                x, y, z = x0 + c * x - s * y, y0 + s * x + c * y, z0 + z
            yield time, self.phases[_last_not_after(own.phase_start, time)], x, y, z

    def extent(self, duration: float) -> str:
        """Return the number of phases, time and length of the path within `duration` [s], for a person."""
        places = list(self.track(duration))
        length = math.total(math.dist(a[2:], b[2:]) for a, b in pairwise(places))
        number = len({phase for _, phase, *_ in places})
        return f"{number} phase{'s' * (number > 1)}, {places[-1][0]:.0f} s, {length:.0f} m"


def ordered_path(member: RunConfig) -> TrajectoryConfig | None:
    """Return the trajectory of a vehicle, given its run configuration alone; None if the scene orders no path."""
    service = member.services.get(NAME)
    parameters = service.parameters if service is not None else None
    return parameters if isinstance(parameters, TrajectoryConfig) else None


def _place(path: Parameters, time: float) -> tuple[float, float, float]:
    x, y, z = path.origin_world
    return x + _channel_at(path.x, time)[0], y + _channel_at(path.y, time)[0], z + _channel_at(path.z, time)[0]


def create(config: RunConfig) -> Service:
    """Return the trajectory service of a run."""
    settings: Any = config.services[NAME]
    block = Block(NAME, settings.parameters.core, Cell(0.0), settings.inputs, settings.ports)
    return Service(NAME, [block], [setpoint_encoder(TRAJECTORY, ports.TRAJECTORY, settings.parameters.phases)])
