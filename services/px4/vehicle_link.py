"""MAVLink over UDP between PX4 and a run: mission, state of the flight, battery of the scene."""

from lapwing.kernels import math
from lapwing.services.common import ports
from lapwing.services.common.firmware.flight_status import poll_flight
from lapwing.services.common.firmware.link import FirmwareOutput, Read
from lapwing.services.common.firmware.mavlink_transport import UdpTransport
from lapwing.services.common.firmware.mission_client import MissionClient
from lapwing.services.common.firmware.mission_messages import mission_items, mission_messages
from lapwing.services.common.firmware.setup import FirmwareSetup
from lapwing.services.px4.modes import CONVENTIONS

BATTERY_EVERY = 0.5  # [s]


class VehicleLink:
    """MAVLink connection to one PX4, polled from the lock step."""

    def __init__(self, setup: FirmwareSetup, transport: UdpTransport):
        """Create the client of a PX4 that has not sent anything yet."""
        items, parameters = mission_items(setup.plan), {} if setup.command else dict(setup.parameters)
        self._client = MissionClient(transport, CONVENTIONS, mission_messages(items, setup.own.datum), parameters)
        self._battery, self._battery_at = setup.own.battery, 0.0  # [s] of the next message

    def next_poll_tick(self, interval: float) -> int:
        """Return the tick of the next poll; `interval`: [s] of a tick."""
        return self._client.next_poll_tick(interval)

    @property
    def version(self) -> str:
        """Version of the firmware, "" if it is not known."""
        return self._client.version

    def poll(self, time: float, read: Read) -> FirmwareOutput:
        """Poll at simulation `time` [s], and send the battery. Return the state of the flight, without outputs."""
        result = poll_flight("px4", self._client, time)
        if self._battery and time >= self._battery_at:
            self._battery_at = time + BATTERY_EVERY
            battery = read(ports.BATTERY)
            if math.isfinite(battery.charge):
                self._client.send_battery(battery.voltage, battery.current, battery.charge)
        return result

    def restart(self) -> None:
        """Start over after a restart of PX4: upload the mission, and arm."""
        self._client.restart()

    def close(self) -> None:
        """Close the link."""
        self._client.close()
