"""Run configuration of a campaign's flights."""

from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.scene import Scene
from lapwing.messages.topics import ACTUATORS, ESTIMATE, SETPOINT, STATUS, TRUTH
from lapwing.services.autopilot.schema import Autopilot
from lapwing.services.common.communication_schema import Communication, Rates
from lapwing.services.common.run_schema import follows_trajectory
from lapwing.services.scene_resolver import resolve

TOPICS = (TRUTH, SETPOINT, ACTUATORS, ESTIMATE, STATUS)


def campaign_setup(scene: Scene) -> RunConfig:
    """The set-up of a flight of this scene, with an estimate at every tick.

    Raises:
        ValueError: nobody flies along a trajectory in this scene.
    """
    if scene.vehicles:
        for vehicle in scene.vehicles:
            _check(vehicle)
    else:
        _check(scene)
    return resolve(scene.replaced(scene[Rates].model_copy(update={"estimate": scene[Communication].rate})))


def _check(scene: Scene) -> None:
    if not scene.has(Autopilot) or not follows_trajectory(scene):
        raise ValueError(f"{scene.path}: expected a scene whose autopilot follows a [trajectory]")
