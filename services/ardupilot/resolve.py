"""Resolution of a scene that ArduPilot flies."""

from typing import NamedTuple

from lapwing.cosim.config.run_config import ServiceConfig
from lapwing.cosim.scene import Scene
from lapwing.dynamics.config_error import ConfigError
from lapwing.dynamics.vector import Vec3
from lapwing.services.ardupilot.schema import ArduPilot
from lapwing.services.common import ports
from lapwing.services.common.communication_schema import Communication
from lapwing.services.common.environment_schema import environment
from lapwing.services.common.firmware.mission import with_mission
from lapwing.services.common.firmware.schema import firmware_of
from lapwing.services.common.firmware.setup import firmware_config, fleet
from lapwing.services.common.mavlink.geo_coordinates import Datum
from lapwing.services.common.vehicle_schema import gravity, start_height

__all__ = ["fleet", "resolve"]
NAME = "ardupilot"
LOOP_RATE = 400  # [Hz] of ArduCopter's main loop, which the rate of the exchange must exceed


class ArduPilotSetup(NamedTuple):
    """Resolved values of the adapter."""

    datum: Datum  # origin of the mission
    gravity_world: Vec3  # [m/s^2]
    rate: float  # [Hz] of the exchange
    imu: bool  # rates and specific force of the IMU, otherwise ground truth
    range_port: str  # port of the distance sensor; "": none
    airspeed: bool
    gps: bool  # the scene has a receiver, whose outages are sent to ArduPilot


def resolve(scene: Scene) -> ServiceConfig | None:
    """Return the configuration of the adapter. Return None unless ArduPilot flies the vehicle.

    Raises:
        ConfigError: the rate is too low, the IMU is missing, or ArduPilot does not fly the airframe.
    """
    if firmware_of(scene) != NAME:
        return None
    exchange = scene[Communication]
    if exchange.rate <= LOOP_RATE:
        message = f"got {exchange.rate:g} Hz, ArduPilot's loop runs at {LOOP_RATE} Hz"
        raise ConfigError("communication.rate", message, f"more than {LOOP_RATE} Hz")
    sensors = set(scene.tables("sensors"))
    imu = scene.has(ArduPilot) and scene[ArduPilot].inertial == "sensors"
    if imu and ports.IMU not in sensors:
        raise ConfigError("ardupilot.inertial", '"sensors" needs an IMU', "[sensors.imu] too")
    distance = next((name for name in (ports.RANGEFINDER, ports.SONAR) if name in sensors), "")
    home = environment(scene).home
    own = ArduPilotSetup(
        Datum(home, start_height(scene), start_height(scene)),
        (0.0, 0.0, -gravity(scene)),
        exchange.rate,
        imu,
        distance,
        ports.AIRSPEED in sensors,
        ports.GPS in sensors,
    )
    inputs = [ports.TRUTH, *([ports.IMU] if imu else []), *([distance] if distance else [])]
    inputs += [ports.AIRSPEED] if own.airspeed else []
    inputs += [ports.GPS] if own.gps else []
    return with_mission(scene, ArduPilot, firmware_config(scene, tuple(inputs), 1, own))
