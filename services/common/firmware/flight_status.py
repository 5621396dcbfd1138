"""State of a flight from the firmware's MAVLink link, as the output of an adapter."""

from lapwing.services.common.firmware.link import FirmwareError, FirmwareOutput
from lapwing.services.common.firmware.mission_client import MissionClient, Stage


class FlightStatus:
    """Flight state from the client of a MAVLink link."""

    def __init__(self, firmware: str, client: MissionClient):
        """Create the status of a client."""
        self._firmware, self._client = firmware, client

    @property
    def version(self) -> str:
        """Version of the firmware, "" if it is not known."""
        return self._client.version

    def poll(self, time: float) -> None:
        """Poll the client at simulation `time` [s].

        Raises:
            FirmwareError: the firmware rejects the mission.
        """
        self._client.poll(time)
        if self._client.error:
            message = f"{self._firmware}: {self._client.error} at t = {time:.3f} s"
            raise FirmwareError(f"{message}; change the mission")

    def output(self, motors: tuple[float, ...], running: bool) -> FirmwareOutput:
        """Return the output with these motor outputs; `running`: they prove that the vehicle is armed."""
        client = self._client
        return FirmwareOutput(
            motors,
            client.armed or running,
            client.landed and not running,
            client.stage is Stage.FINISHED,
            client.mode,
            client.texts.failsafe if client.armed else "",
            tuple(client.texts.blockers),
        )
