"""Resolution of a scene that PX4 flies."""

from typing import NamedTuple

from lapwing.cosim.config.run_config import ServiceConfig
from lapwing.cosim.scene import Scene
from lapwing.dynamics import atmosphere
from lapwing.dynamics.config_error import ConfigError
from lapwing.dynamics.lie import quaternion
from lapwing.dynamics.vector import Vec3
from lapwing.kernels import python_function
from lapwing.services.common import ports
from lapwing.services.common.communication_schema import ticks
from lapwing.services.common.environment_schema import environment
from lapwing.services.common.firmware.mission import with_mission
from lapwing.services.common.firmware.schema import firmware_of
from lapwing.services.common.firmware.setup import firmware_config, fleet
from lapwing.services.common.mavlink.geo_coordinates import Datum
from lapwing.services.common.vehicle_schema import gravity, start_height, start_pose
from lapwing.services.px4.schema import Px4

__all__ = ["fleet", "resolve"]
NAME = "px4"
REQUIRED = (ports.IMU, ports.MAGNETOMETER, ports.BAROMETER, ports.GPS)
BATTERIES = ("battery", "battery_thevenin")  # effects that model the charge
OPTIONAL = (ports.AIRSPEED, ports.RANGEFINDER, ports.SONAR)
_rotate_back = python_function(quaternion.rotate_back)
_pressure = python_function(atmosphere.pressure)


class Px4Setup(NamedTuple):
    """Resolved values of the adapter."""

    datum: Datum  # origin of the mission
    periods: dict[str, int]  # [ticks] between two readings, by port
    force_body: Vec3  # [m/s^2] specific force at rest at the start
    field_body: Vec3  # [T] magnetic field there
    pressure: float  # [Pa] there
    battery: bool = False  # the scene models the battery: PX4 gets its state instead of its own simulation


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
    here, (position, attitude) = environment(scene), start_pose(scene)
    own = Px4Setup(
        Datum(here.home, start_height(scene), start_height(scene)),
        periods,
        _rotate_back(attitude, (0.0, 0.0, gravity(scene))),
        _rotate_back(attitude, here.magnetic_field_world),
        _pressure(here.atmosphere, here.home.height + position[2]),
        any(name in scene.tables("effects") for name in BATTERIES),
    )
    return with_mission(scene, Px4, firmware_config(scene, tuple(sensors), periods[ports.IMU], own))
