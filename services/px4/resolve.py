"""Resolution of a scene that PX4 flies."""

from collections.abc import Sequence
from typing import NamedTuple

from lapwing.cosim.config.run_config import ServiceConfig
from lapwing.cosim.scene import Scene
from lapwing.dynamics import atmosphere, geodesy
from lapwing.dynamics.config_error import ConfigError
from lapwing.dynamics.lie import quaternion
from lapwing.dynamics.vector import Vec3
from lapwing.kernels import python_function
from lapwing.services.common import ports
from lapwing.services.common.firmware.firmware_config import firmware_config, fleet, latencies
from lapwing.services.common.firmware.mission import with_mission
from lapwing.services.common.firmware.motor_order import motors
from lapwing.services.common.firmware.schema import firmware_of
from lapwing.services.common.mavlink.geo_coordinates import Datum
from lapwing.services.common.schemas.communication_schema import ticks
from lapwing.services.common.schemas.environment_schema import environment
from lapwing.services.common.schemas.vehicle_schema import gravity, start_height, start_pose
from lapwing.services.px4.schema import RC, Px4

__all__ = ["fleet", "resolve"]
NAME = "px4"
REQUIRED = (ports.IMU, ports.MAGNETOMETER, ports.BAROMETER, ports.GPS)
DELAYS = {  # parameters [ms] of the delay of each sensor; of GPS also the name before PX4 1.17
    ports.GPS: ("SENS_GPS0_DELAY", "EKF2_GPS_DELAY"),
    ports.BAROMETER: ("EKF2_BARO_DELAY",),
    ports.MAGNETOMETER: ("EKF2_MAG_DELAY",),
    ports.AIRSPEED: ("EKF2_ASP_DELAY",),
    ports.RANGEFINDER: ("EKF2_RNG_DELAY",),
    ports.OPTICAL_FLOW: ("EKF2_OF_DELAY",),
    ports.EXTERNAL_VISION: ("EKF2_EV_DELAY",),
}
DELAY_MAX = 200.0  # [ms] EKF2_DELAY_MAX of PX4, which no delay may exceed
IMU_RATES = (100, 200, 250, 400)  # [Hz] values of IMU_INTEG_RATE
TRUTH_PERIOD = 10  # steps between two messages of the true state, which only PX4's log uses
OPTIONAL = (ports.AIRSPEED, ports.RANGEFINDER, ports.SONAR, ports.OPTICAL_FLOW, ports.EXTERNAL_VISION)
RC_PERIOD = 0.02  # [s] between two messages of the radio
RADIO = {
    "COM_RC_IN_MODE": 0.0,
    "RC_CHAN_CNT": 8.0,
    "RC_MAP_ROLL": 1.0,
    "RC_MAP_PITCH": 2.0,
    "RC_MAP_THROTTLE": 3.0,
    "RC_MAP_YAW": 4.0,
}
FUSED = {  # parameters that let PX4's filter use a sensor: flow; horizontal and vertical position, and yaw
    ports.OPTICAL_FLOW: ("EKF2_OF_CTRL", 1.0),
    ports.EXTERNAL_VISION: ("EKF2_EV_CTRL", 11.0),
}
_rotate_back = python_function(quaternion.rotate_back)
_pressure = python_function(atmosphere.pressure)
_height_above_home = python_function(geodesy.height_above_home)


class Px4Config(NamedTuple):
    """Resolved values of the adapter."""

    datum: Datum  # origin of the mission
    periods: dict[str, int]  # [ticks] between two readings, by port
    force_body: Vec3  # [m/s^2] specific force at rest at the start
    field_body: Vec3  # [T] magnetic field there
    pressure: float  # [Pa] there
    parameters: dict[str, float]  # PX4 parameters that describe the scene's sensors, radio, battery and rotors
    rc: Sequence[Sequence[float]] = ()  # rows of `Px4.rc`


def resolve(scene: Scene) -> ServiceConfig | None:
    """Return the configuration of the adapter. Return None unless PX4 flies the vehicle.

    Raises:
        ConfigError: a sensor is missing, or PX4 does not fly the airframe.
    """
    if firmware_of(scene) != NAME:
        return None
    tables = scene.tables("sensors")
    missing = ", ".join(f"[sensors.{name}]" for name in REQUIRED if name not in tables)
    if missing:
        raise ConfigError("autopilot.firmware", f'"px4" needs {missing}; add them or choose another firmware')
    sensors = [*REQUIRED, *(name for name in OPTIONAL if name in tables)]
    periods = {name: ticks(scene, scene.lookup(f"sensors.{name}.rate"), name) for name in sensors}
    for name, units in ports.REDUNDANT.items():
        periods |= dict.fromkeys(units[: scene.lookup(f"sensors.{name}.instances") - 1], periods[name])
    periods[ports.TRUTH] = TRUTH_PERIOD * periods[ports.IMU]
    received, rc = tuple(periods), scene[Px4].rc if scene.has(Px4) else []
    if rc:
        periods[RC] = periods[ports.IMU] * max(1, round(RC_PERIOD * scene.lookup(f"sensors.{ports.IMU}.rate")))
    here, (position, attitude) = environment(scene), start_pose(scene)
    own = Px4Config(
        Datum(here.home, start_height(scene), start_height(scene)),
        periods,
        _rotate_back(attitude, (0.0, 0.0, gravity(scene))),
        _rotate_back(attitude, here.magnetic_field_world),
        _pressure(here.atmosphere, here.home.height + _height_above_home(here.home, position)),
        sensor_parameters(scene) | (RADIO if rc else {}),
        rc,
    )
    return with_mission(scene, Px4, firmware_config(scene, received, periods[ports.IMU], own))


def sensor_parameters(scene: Scene) -> dict[str, float]:
    """Return the PX4 parameters that describe the scene: its rotors, delays of its sensors, rate of its IMU.

    SIM_BAT_ENABLE = 0, from 1.17 SIM_BAT_DRAIN = 0: PX4 gets the state of the plant's battery instead of its own
    simulation. COM_FLTT_LOW_ACT = 1 (warning): until mid-2026, PX4 takes the unknown remaining flight time of such a
    battery for 0 s, and would return at once; 0 (no action) would hold for 5 s.
    """
    delays = latencies(scene, DELAYS)
    result = {"SIM_BAT_ENABLE": 0.0, "SIM_BAT_DRAIN": 0.0, "COM_FLTT_LOW_ACT": 1.0}
    result["EKF2_DELAY_MAX"] = max(DELAY_MAX, *delays.values())
    result |= dict(FUSED[name] for name in scene.tables("sensors") if name in FUSED)
    rate = scene.lookup(f"sensors.{ports.IMU}.rate")
    return result | motors(scene).parameters | delays | ({"IMU_INTEG_RATE": rate} if rate in IMU_RATES else {})
