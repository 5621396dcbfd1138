"""State of a flight from the firmware's MAVLink link."""

from lapwing.services.common.firmware.link import FirmwareError, FirmwareOutput
from lapwing.services.common.firmware.mission_client import MissionClient, Stage


def poll_flight(firmware: str, client: MissionClient, time: float) -> FirmwareOutput:
    """Poll the client at simulation `time` [s]. Return the state of the flight, without outputs.

    Raises:
        FirmwareError: the firmware rejects the mission.
    """
    client.poll(time)
    if client.error:
        raise FirmwareError(f"{firmware}: {client.error} at t = {time:.3f} s; change the mission")
    failsafe = client.texts.failsafe if client.armed else ""
    finished = client.stage is Stage.FINISHED
    return FirmwareOutput(
        (), client.armed, client.landed, finished, client.mode, failsafe, tuple(client.texts.blockers)
    )
