"""GPS outages and battery of the scene for ArduPilot's own sensor models, which the JSON interface does not reach.

They are set by parameters of the simulation while it runs. Sources: ArduPilot, SITL.cpp and SITL_State_common.cpp.
"""

from lapwing.kernels import math
from lapwing.services.ardupilot.resolve import ArduPilotSetup
from lapwing.services.common import ports
from lapwing.services.common.firmware.link import Read
from lapwing.services.common.firmware.mission_client import MissionClient

EVERY = 0.2  # [s] between two updates
SAG = 0.7  # [V] that ArduPilot subtracts at full throttle


class SimulatedSensors:
    """Sender of the parameters, which are sent when they change."""

    def __init__(self, own: ArduPilotSetup, client: MissionClient):
        """Store the adapter's values and the client."""
        self._own, self._client = own, client
        self._fix = True  # as ArduPilot starts
        self._next = 0.0  # [s] of the next update

    def update(self, time: float, read: Read, motors: tuple[float, ...]) -> None:
        """Set the parameters at simulation `time` [s]; `motors`: outputs, 0 to 1."""
        if time < self._next or not self._client.connected:
            return
        self._next = time + EVERY
        if self._own.gps and (fix := read(ports.GPS).valid) != self._fix:
            self._fix = fix
            self._client.send_parameter("SIM_GPS_DISABLE", float(not fix))  # name up to version 4.5
            self._client.send_parameter("SIM_GPS1_ENABLE", float(fix))
        if math.isfinite((battery := read(ports.BATTERY)).charge):
            throttle = math.total(motors) / len(motors)
            self._client.send_parameter("SIM_BATT_VOLTAGE", battery.voltage + SAG * throttle)
