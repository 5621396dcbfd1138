"""The service of ArduPilot's adapter."""

from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.diagram.block_diagram import Service
from lapwing.services.ardupilot.link import ArduPilotLink
from lapwing.services.common.firmware.playback import Recorded
from lapwing.services.common.firmware.service import firmware_service

NAME = "ardupilot"


def create(setup: RunConfig, recorded: Recorded | None = None) -> Service:
    """Return the adapter of a run; `recorded` replaces the firmware by the commands of a log."""
    return firmware_service(setup, NAME, ArduPilotLink, recorded)
