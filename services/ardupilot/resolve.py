"""Resolution of a scene that ArduPilot flies."""

from typing import NamedTuple

from lapwing.cosim.config.run_config import ServiceConfig
from lapwing.cosim.scene import Scene
from lapwing.dynamics.config_error import ConfigError
from lapwing.dynamics.vector import Vec3
from lapwing.services.ardupilot.schema import ArduPilot
from lapwing.services.common import ports
from lapwing.services.common.firmware.firmware_config import firmware_config, fleet, latencies
from lapwing.services.common.firmware.mission import with_mission
from lapwing.services.common.firmware.motor_order import motors
from lapwing.services.common.firmware.schema import firmware_of
from lapwing.services.common.mavlink.geo_coordinates import Datum
from lapwing.services.common.schemas.communication_schema import Communication
from lapwing.services.common.schemas.environment_schema import environment
from lapwing.services.common.schemas.vehicle_schema import gravity, start_height

__all__ = ["fleet", "resolve"]
NAME = "ardupilot"
SIMULATED = {  # parameters [ms] of the delay of ArduPilot's model of each sensor, and of that which its filter expects
    ports.GPS: ("SIM_GPS1_LAG_MS", "GPS1_DELAY_MS", "SIM_GPS_LAG_MS", "GPS_DELAY_MS"),  # the last two up to 4.5
    ports.BAROMETER: ("SIM_BARO_DELAY", "EK3_HGT_DELAY"),
    ports.MAGNETOMETER: ("SIM_MAG_DELAY",),
}
DELAY_MIN = 1.0  # [ms] GPS1_DELAY_MS, where 0 stands for the delay that ArduPilot expects of a kind of receiver
VOLTAGE_AND_CURRENT = 4.0  # BATT_MONITOR
LOOP_RATE = 400  # [Hz] of ArduCopter's main loop, which the rate of the exchange must exceed


class ArduPilotConfig(NamedTuple):
    """Resolved values of the adapter."""

    datum: Datum  # origin of the mission
    gravity_world: Vec3  # [m/s^2]
    rate: float  # [Hz] of the exchange
    imu: bool  # rates and specific force of the IMU, otherwise ground truth
    range_port: str  # port of the distance sensor; "": none
    airspeed: bool
    gps: bool  # the scene has a receiver, whose outages are sent to ArduPilot
    parameters: dict[str, float]  # ArduPilot parameters that describe the scene's sensors, battery and rotors


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
    own = ArduPilotConfig(
        Datum(home, start_height(scene), start_height(scene)),
        (0.0, 0.0, -gravity(scene)),
        exchange.rate,
        imu,
        distance,
        ports.AIRSPEED in sensors,
        ports.GPS in sensors,
        sensor_parameters(scene),
    )
    inputs = [ports.TRUTH, *([ports.IMU] if imu else []), *([distance] if distance else [])]
    inputs += [ports.AIRSPEED] if own.airspeed else []
    inputs += [ports.GPS] if own.gps else []
    return with_mission(scene, ArduPilot, firmware_config(scene, tuple(inputs), 1, own))


def sensor_parameters(scene: Scene) -> dict[str, float]:
    """Return the ArduPilot parameters that describe the scene: its rotors, delays and rate of its sensors.

    BATT_MONITOR = 4: ArduPilot measures the plant's battery, and its log has the voltage. SIM_VIB_MOT_MASK names the
    motors whose throttle lowers this voltage, which `SimulatedSensors` compensates; by default 4.7 knows none.
    ArduPilot's parameters of IMU noise, 0 by default, then act in flight; there is no vibration without them.
    """
    order, result = motors(scene)
    result |= {"BATT_MONITOR": VOLTAGE_AND_CURRENT, "SIM_VIB_MOT_MASK": 2.0 ** len(order) - 1.0}
    result |= latencies(scene, SIMULATED)
    if ports.GPS in scene.tables("sensors"):
        rate = scene.lookup(f"sensors.{ports.GPS}.rate")
        result |= {"SIM_GPS1_HZ": rate, "SIM_GPS_HZ": rate}
        result |= {name: max(result[name], DELAY_MIN) for name in ("GPS1_DELAY_MS", "GPS_DELAY_MS")}
    return result
