"""What a campaign looks at in a flight."""

from cosim.scene import Scene
from cosim.setup import Setup
from messages.topics import ACTUATORS, ESTIMATE, SETPOINT, STATUS, TRUTH
from services.autopilot.config import Autopilot
from services.common.exchange import Exchange, Rates
from services.common.sections import follows_trajectory
from services.table import resolve

TOPICS = (TRUTH, SETPOINT, ACTUATORS, ESTIMATE, STATUS)


def campaign_setup(scene: Scene) -> Setup:
    """The set-up of a flight of this scene, with an estimate at every tick.

    Raises:
        ValueError: nobody flies along a trajectory in this scene.
    """
    if scene.vehicles:
        for vehicle in scene.vehicles:
            _check(vehicle)
    else:
        _check(scene)
    return resolve(scene.replaced(scene[Rates].model_copy(update={"estimate": scene[Exchange].rate})))


def _check(scene: Scene) -> None:
    if not scene.has(Autopilot) or not follows_trajectory(scene):
        raise ValueError(f"{scene.path}: expected a scene whose autopilot follows a [trajectory]")
