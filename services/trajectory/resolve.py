"""From a scene's `[trajectory]` to what is evaluated at every tick."""

from cosim.scene import Scene
from cosim.schedule import Input, Port
from cosim.setup import ServiceSetup
from services.common import ports
from services.common.exchange import Exchange
from services.common.ports import Reference
from services.common.sections import follows_trajectory
from services.common.vehicle import start_place
from services.trajectory.config import Trajectory
from services.trajectory.core import TrajectoryPath
from services.trajectory.mission import compile
from services.trajectory.service import TrajectorySetup

LEAD = 0.1  # [s] the references are ahead of the plant at the most


def resolve(scene: Scene) -> ServiceSetup | None:
    """The trajectory of a scene; None where nobody flies along one."""
    if not follows_trajectory(scene):
        return None
    exchange = scene[Exchange]
    compiled = compile(scene[Trajectory], start_place(scene))
    core = TrajectoryPath(compiled.parameters, compiled.final, exchange.interval)
    ahead = max(1, round(LEAD * exchange.rate))
    return ServiceSetup(
        TrajectorySetup(core, compiled.phases),
        (Input(ports.TRUTH, ahead),),
        (Port(ports.TRAJECTORY, Reference()),),
    )
