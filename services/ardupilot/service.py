"""Service of the lock step that exchanges samples with ArduPilot."""

from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.diagram.block_diagram import Service
from lapwing.services.ardupilot.link import ArduPilotLink
from lapwing.services.common.firmware.playback import Recorded
from lapwing.services.common.firmware.service import firmware_service

NAME = "ardupilot"


def create(setup: RunConfig, recorded: Recorded | None = None) -> Service:
    """Return the service that lets ArduPilot fly a run.

    Args:
        setup: run configuration.
        recorded: messages of a log by topic and tick, which replace the firmware; None to connect to the firmware.
    """
    return firmware_service(setup, NAME, ArduPilotLink, recorded)
