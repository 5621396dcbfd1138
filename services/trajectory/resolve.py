"""Resolution of a scene's `[trajectory]` into the service's configuration."""

from collections.abc import Mapping

import numpy as np

from lapwing.cosim.config.run_config import ServiceConfig
from lapwing.cosim.diagram.tick_schedule import InputPort, Port
from lapwing.cosim.scene import Scene
from lapwing.dynamics.config_error import ConfigError
from lapwing.dynamics.vector import subtract
from lapwing.services.common import ports
from lapwing.services.common.ports import Setpoint
from lapwing.services.common.schemas.communication_schema import Communication
from lapwing.services.common.schemas.run_schema import follows_trajectory
from lapwing.services.common.schemas.vehicle_schema import start_place
from lapwing.services.trajectory.block import TrajectoryPath
from lapwing.services.trajectory.leader_follower import FollowedPath
from lapwing.services.trajectory.polynomial_piece import Parameters
from lapwing.services.trajectory.schema import Trajectory, compile_trajectory
from lapwing.services.trajectory.service import TrajectoryConfig

LEAD = 0.2  # [s] maximum lead of the references over the plant


def resolve(scene: Scene) -> ServiceConfig | None:
    """Return the configuration of the trajectory service. Return None if the vehicle follows no trajectory."""
    if not follows_trajectory(scene):
        return None
    exchange = scene[Communication]
    result = compile_trajectory(scene)
    path = result.parameters._replace(origin_world=start_place(scene))
    core = TrajectoryPath(path, result.final, exchange.interval)
    lead_ticks = max(1, round(LEAD * exchange.rate))
    return ServiceConfig(
        TrajectoryConfig(core, result.phases),
        (InputPort(ports.TRUTH, lead_ticks),),
        (Port(ports.TRAJECTORY, Setpoint()),),
    )


def fleet(
    shares: Mapping[str, ServiceConfig], keys: Mapping[str, str], scenes: Mapping[str, Scene]
) -> dict[str, ServiceConfig]:
    """Return the trajectories by vehicle name, with followers combined with their leaders' paths.

    See `plant.resolve.fleet` for arguments.

    Raises:
        ConfigError: a leader does not exist or follows another vehicle.
    """
    tables = {name: scenes[name][Trajectory] for name in shares}
    alone = {name: share.parameters.core for name, share in shares.items() if not tables[name].leader}
    return {name: _follower_config(share, tables[name], alone, keys[name]) if tables[name].leader else share
            for name, share in shares.items()}  # fmt: skip


def _follower_config(
    share: ServiceConfig, table: Trajectory, leaders: Mapping[str, TrajectoryPath], key: str
) -> ServiceConfig:
    leader = table.leader or ""
    if leader not in leaders:
        expected = f"a vehicle with a trajectory and no leader: {', '.join(leaders) or 'there is none'}"
        raise ConfigError(f"{key}trajectory.leader", f"got {leader}", expected)
    path, core = leaders[leader], share.parameters.core
    if all(np.array_equal(*pair) for pair in zip(_numbers(core.path), _numbers(path.path), strict=True)):
        message = f"repeats the phases of {leader}, which doubles the displacement"
        raise ConfigError(f"{key}trajectory.phase", message, "phases relative to the leader")
    origin = subtract(core.path.origin_world, path.path.origin_world)
    relative = core._replace(path=core.path._replace(origin_world=origin))
    follower = FollowedPath(path, relative, heading=table.frame != "world")
    return share._replace(parameters=share.parameters._replace(core=follower))


def _numbers(path: Parameters) -> list[np.ndarray]:
    return [part for channel in (path.x, path.y, path.z, path.yaw) for part in channel]
