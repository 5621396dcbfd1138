"""Resolution of a scene's `[sensors]` into the service's configuration."""

import math
import sys
from collections.abc import Mapping
from types import ModuleType
from typing import Any

import numba

from lapwing.cosim.config import user_module
from lapwing.cosim.config.run_config import ServiceConfig
from lapwing.cosim.diagram.multi_vehicle import neighbour_port
from lapwing.cosim.diagram.tick_schedule import InputPort, Port
from lapwing.cosim.scene import Scene
from lapwing.dynamics.config_error import ConfigError
from lapwing.dynamics.lie.quaternion import NO_ROTATION
from lapwing.dynamics.noise import stream_key
from lapwing.dynamics.terrain.ray_casting import as_relief, steepness
from lapwing.dynamics.vector import ZERO
from lapwing.dynamics.vehicles.visible_body import VisibleBody, visible_body
from lapwing.services.common import ports
from lapwing.services.common.schemas.communication_schema import Communication, ticks
from lapwing.services.common.schemas.environment_schema import environment
from lapwing.services.common.schemas.run_schema import Run
from lapwing.services.common.schemas.vehicle_schema import Vehicle, VehicleAirframe, airframe, gravity
from lapwing.services.sensors.gps import Gps
from lapwing.services.sensors.imu import Imu
from lapwing.services.sensors.rotor_vibration import Damage
from lapwing.services.sensors.scan import ScanPose, VehiclePose
from lapwing.services.sensors.schema import Sensors, module_of, parameters
from lapwing.services.sensors.sensor_inputs import OtherVehicle, Truth
from lapwing.services.sensors.service import Instrument


def resolve(scene: Scene) -> ServiceConfig | None:
    """Return the configuration of the scene's sensors. Return None without any."""
    tables = scene[Sensors].tables
    if not tables:
        return None
    instruments, outputs = [], []
    surroundings = environment(scene)._replace(gravity=gravity(scene))
    for name, table in sorted(tables.items()):
        p = parameters(name, table, scene[Communication].interval)
        if name == ports.IMU:
            p = _with_damage(scene, p)
        elif name == ports.GPS:
            p = _with_terrain(scene, p)
        key = stream_key(scene[Run].seed, scene[Vehicle].name, name)
        instruments.append(Instrument(p, key, surroundings))
        reading = trial_reading(name, table, p) if "module" in table else module_of(name, table).READING
        outputs.append(Port(name, reading, ticks(scene, p.rate, f"sensors.{name}.rate")))
        for unit in ports.REDUNDANT[name][: p.instances - 1] if name in ports.REDUNDANT else ():
            if unit in tables:
                message = f"is the name of a redundant unit of sensors.{name}"
                raise ConfigError(f"sensors.{unit}", message, "another name")
            key = stream_key(scene[Run].seed, scene[Vehicle].name, unit)
            instruments.append(Instrument(p._replace(faults=None), key, surroundings))
            outputs.append(outputs[-1]._replace(name=unit))
    return ServiceConfig(tuple(instruments), (InputPort(ports.TRUTH),), tuple(outputs))


def _with_damage(scene: Scene, p: Imu) -> Imu:
    """Return the IMU with the scene's `effects.rotor_damage` as a source of vibration."""
    damage = scene.tables("effects").get("rotor_damage")
    if damage is None or p.rotor_vibration is None:
        return p
    start = math.ceil(damage.get("time", 0.0) / scene[Communication].interval - 1e-9)
    rotor_damage = Damage(damage["rotor"] - 1, start, 1.0 - damage.get("remaining_thrust", 0.0))
    return p._replace(rotor_vibration=p.rotor_vibration._replace(damage=rotor_damage))


def _with_terrain(scene: Scene, p: Gps) -> Gps:
    """Return the receiver with the steepness of the ground that shades satellites."""
    if p.constellation is None:
        return p
    steep = steepness(as_relief(environment(scene).terrain))
    return p._replace(constellation=p.constellation._replace(steepness=steep))


def fleet(
    shares: Mapping[str, ServiceConfig], keys: Mapping[str, str], scenes: Mapping[str, Scene]
) -> dict[str, ServiceConfig]:
    """Return the sensors by vehicle name; those that see vehicles have the others' true states as inputs.

    A vehicle without an airframe has no dimensions and is not seen. See `plant.resolve.fleet` for arguments.
    """
    bodies = {name: visible_body(airframe(scene)) for name, scene in scenes.items() if scene.has(VehicleAirframe)}
    return {
        name: _with_others(share, {other: body for other, body in bodies.items() if other != name})
        for name, share in shares.items()
    }


def _with_others(settings: ServiceConfig, bodies: Mapping[str, VisibleBody]) -> ServiceConfig:
    before: tuple[Instrument, ...] = settings.parameters
    seeing = [_sees_vehicles(sys.modules[type(i.sensor).__module__]) for i in before]
    if not bodies or not any(seeing):
        return settings
    instruments, outputs = [], []
    for sees, instrument, port in zip(seeing, before, settings.ports, strict=True):
        instruments.append(instrument._replace(others=tuple(bodies.values())) if sees else instrument)
        if isinstance(port.example, ScanPose):
            port = port._replace(example=port.example._replace(others=(VehiclePose(),) * len(bodies)))
        outputs.append(port)
    inputs = (*settings.inputs, *(InputPort(neighbour_port(other, ports.TRUTH)) for other in bodies))
    return ServiceConfig(tuple(instruments), inputs, tuple(outputs))


def _sees_vehicles(module: ModuleType) -> bool:
    return bool(getattr(module, "SEES_VEHICLES", False))


def reseed(settings: ServiceConfig, seed: int, vehicle: str) -> ServiceConfig:
    """Return the instruments with another seed."""
    instruments = tuple(
        instrument._replace(key=stream_key(seed, vehicle, port.name))
        for instrument, port in zip(settings.parameters, settings.ports, strict=True)
    )
    return settings._replace(parameters=instruments)


def trial_reading(name: str, table: Mapping[str, Any], p: Any) -> Any:
    """Return the reading of a custom sensor after a trial sample.

    Args:
        name: name of the sensor.
        table: scene table.
        p: parameters.

    Raises:
        ConfigError: it cannot be sampled, or its types differ from the declared ones.
    """
    module, where = module_of(name, table), f"sensors.{name}.module"
    key, truth = stream_key(0, "trial", name), Truth()
    if _sees_vehicles(module):
        truth = truth._replace(others=(OtherVehicle(ZERO, NO_ROTATION, VisibleBody(0.0, 0.0, 1.0, 0.0, 1.0)),))
    try:
        state = module.initial(p, key, truth)
        after, reading = module.sample(p, state, key, 0, truth)
    except user_module.FAULTS as error:
        raise ConfigError(where, user_module.blame(error, module)) from error
    for value_name, result, declared in (
        ("initial", state, module.blank()),
        ("sample's state", after, module.blank()),
        ("sample's reading", reading, module.READING),
    ):
        if numba.typeof(result) != numba.typeof(declared):
            raise ConfigError(where, f"{value_name} is of another type than `blank` or `READING` declares")
    return module.READING
