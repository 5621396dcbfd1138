"""The service of PX4's adapter."""

from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.diagram.block_diagram import Service
from lapwing.services.common.firmware.playback import Recorded
from lapwing.services.common.firmware.service import firmware_service
from lapwing.services.px4.link import Px4Link

NAME = "px4"


def create(setup: RunConfig, recorded: Recorded | None = None) -> Service:
    """Return the adapter of a run; `recorded` replaces the firmware by the commands of a log."""
    return firmware_service(setup, NAME, Px4Link, recorded)
