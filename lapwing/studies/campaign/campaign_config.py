"""Run configuration of a campaign's flights."""

from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.scene import Scene
from lapwing.messages.topics import ACTUATORS, ESTIMATE, ESTIMATE_COVARIANCE, SETPOINT, STATUS, TRUTH
from lapwing.services.autopilot.schema import Autopilot
from lapwing.services.common.firmware.schema import flown_by_firmware, require_program
from lapwing.services.common.schemas.communication_schema import Communication, Rates
from lapwing.services.common.schemas.run_schema import follows_trajectory
from lapwing.services.scene_resolver import resolve

TOPICS = (TRUTH, SETPOINT, ACTUATORS, ESTIMATE, ESTIMATE_COVARIANCE, STATUS)


def campaign_config(scene: Scene) -> RunConfig:
    """Return the run configuration of a flight, with an estimate at every tick.

    Raises:
        ValueError: a vehicle has neither a trajectory nor a firmware, or the scene does not start its firmware.
    """
    if scene.vehicles:
        for vehicle in scene.vehicles:
            _check(vehicle)
    else:
        _check(scene)
    return resolve(scene.replaced(scene[Rates].model_copy(update={"estimate": scene[Communication].rate})))


def _check(scene: Scene) -> None:
    if not scene.has(Autopilot) or not (follows_trajectory(scene) or flown_by_firmware(scene)):
        raise ValueError(f"{scene.path}: expected a scene whose autopilot follows a [trajectory]")
    require_program(scene)
