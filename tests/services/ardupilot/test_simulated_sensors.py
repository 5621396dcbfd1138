"""GPS outages and battery voltage of a scene, sent to ArduPilot as parameters of its simulation."""

import math

from pymavlink.dialects.v20 import all as mavlink

from lapwing.services.ardupilot.link import SimulatedSensors
from lapwing.services.ardupilot.modes import CONVENTIONS
from lapwing.services.ardupilot.resolve import ArduPilotConfig
from lapwing.services.common import ports
from lapwing.services.common.firmware.mission_client import MissionClient
from lapwing.services.common.mavlink.geo_coordinates import Datum
from lapwing.services.common.ports import BatteryReading, GpsReading
from lapwing.services.scene_resolver import load, resolve

OWN = ArduPilotConfig(Datum(), (0.0, 0.0, -9.80665), 250.0, False, "", False, True, {})


class Transport:
    """Link to a firmware that sends one heartbeat and stores the parameters that it receives."""

    def __init__(self):
        self._codec, self._reader = mavlink.MAVLink(None, srcSystem=3, srcComponent=1), mavlink.MAVLink(None)
        self._out, self.parameters = b"", []

    def beat(self):
        self._out = mavlink.MAVLink_heartbeat_message(2, 3, 0, 0, 4, 3).pack(self._codec)

    def receive(self):
        data, self._out = self._out, b""
        return data

    def send(self, data):
        for message in self._reader.parse_buffer(data) or ():
            if message.get_type() == "PARAM_SET":
                assert (message.target_system, message.target_component) == (3, 1)
                self.parameters.append((message.param_id, round(message.param_value, 3)))


def fly(times, gps=True, charge=math.nan, throttle=0.0, only=""):
    """Return the parameters set at `times`; `gps(t)`: True if the receiver has a fix."""
    transport = Transport()
    client = MissionClient(transport, CONVENTIONS, (), {})
    sensors = SimulatedSensors(OWN, client)
    fix = gps if callable(gps) else lambda t: gps
    for t in times:
        samples = {ports.GPS: GpsReading(valid=fix(t)), ports.BATTERY: BatteryReading(charge, 11.0, 5.0)}
        sensors.update(t, samples.__getitem__, (0.0, 2.0 * throttle, 0.0, 2.0 * throttle))
        transport.beat()
        client.read()
    return [entry for entry in transport.parameters if only in entry[0]]


def test_gps_outage_disables_receiver_until_end():
    result = fly((0.0, 1.0, 2.0, 3.0, 4.0), gps=lambda t: t not in (2.0, 3.0), only="GPS")
    assert result == [("SIM_GPS_DISABLE", 1.0), ("SIM_GPS1_ENABLE", 0.0),
                      ("SIM_GPS_DISABLE", 0.0), ("SIM_GPS1_ENABLE", 1.0)]  # fmt: skip


def test_outage_before_connection_is_sent_after_connection():
    assert fly((0.0, 1.0), gps=False, only="GPS") == [("SIM_GPS_DISABLE", 1.0), ("SIM_GPS1_ENABLE", 0.0)]


def test_voltage_of_scene_without_battery_effect_is_that_of_plant():
    assert fly((0.0, 0.1, 0.2)) == [("SIM_BATT_VOLTAGE", 11.0)]


def test_battery_voltage_is_set_every_fifth_of_second():
    result = fly((0.0, 0.1, 0.2, 0.35, 0.4), charge=0.5, throttle=0.5)
    assert result == [("SIM_BATT_VOLTAGE", 11.35)] * 2  # ArduPilot subtracts 0.7 V times the throttle


def test_gps_of_scene_is_input_of_link():
    assert not resolve(load("ardupilot_quad")).services["ardupilot"].parameters.own.gps
    config = resolve(load("ardupilot_quad", ["sensors.gps.rate=5"])).services["ardupilot"]
    assert config.parameters.own.gps
    assert (
        config.parameters.own.parameters.items()
        >= {"SIM_GPS1_HZ": 5.0, "SIM_GPS1_LAG_MS": 200.0, "GPS1_DELAY_MS": 200.0}.items()
    )
    assert ports.GPS in [port.port for port in config.inputs]
