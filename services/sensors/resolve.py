"""From the `[sensors]` of a scene to its instruments."""

import math
from collections.abc import Mapping
from typing import Any

import numba

from lapwing.cosim.config.run_config import ServiceConfig
from lapwing.cosim.diagram.tick_schedule import InputPort, Port
from lapwing.cosim.scene import Scene
from lapwing.dynamics.config_error import ConfigError
from lapwing.dynamics.noise import stream_key
from lapwing.messages import NavSatStatus
from lapwing.services.common import ports
from lapwing.services.common.communication_schema import Communication, ticks
from lapwing.services.common.environment_schema import environment
from lapwing.services.common.run_schema import Run
from lapwing.services.common.vehicle_schema import Vehicle, gravity
from lapwing.services.sensors.block import Instrument
from lapwing.services.sensors.encoders import SonarWiring
from lapwing.services.sensors.registry import module_of, parameters
from lapwing.services.sensors.schema import Sensors
from lapwing.services.sensors.sensor_inputs import Truth
from lapwing.services.sensors.service import SensorsSetup

READINGS = {
    ports.IMU: ports.ImuReading(),
    ports.MAGNETOMETER: ports.MagnetometerReading(),
    ports.GPS: ports.GpsReading(),
    ports.BAROMETER: ports.BarometerReading(),
    ports.SONAR: ports.DistanceReading(),
}


def resolve(scene: Scene) -> ServiceConfig | None:
    """The sensors that the scene names; None where it names none."""
    tables = scene[Sensors].tables
    if not tables:
        return None
    instruments, given = [], []
    sonar, fix = None, NavSatStatus.STATUS_FIX
    for name, table in sorted(tables.items()):
        p = parameters(name, table, scene[Communication].interval)
        key = stream_key(scene[Run].seed, scene[Vehicle].name, name)
        instruments.append(Instrument(p, key, gravity(scene), environment(scene)))
        reading = READINGS[name] if name in READINGS else _reading(name, table, p)
        given.append(Port(name, reading, ticks(scene, p.rate, f"sensors.{name}.rate")))
        if name == ports.SONAR:
            sonar = SonarWiring(math.radians(2.0 * p.half_beam_deg), p.range_min, p.range_max)
        elif name == ports.GPS:
            fix = p.fix_status
    return ServiceConfig(SensorsSetup(tuple(instruments), sonar, fix), (InputPort(ports.TRUTH),), tuple(given))


def reseed(given: ServiceConfig, seed: int, vehicle: str) -> ServiceConfig:
    """The same instruments with another seed."""
    setup: SensorsSetup = given.parameters
    instruments = tuple(
        instrument._replace(key=stream_key(seed, vehicle, port.name))
        for instrument, port in zip(setup.instruments, given.ports, strict=True)
    )
    return given._replace(parameters=setup._replace(instruments=instruments))


def _reading(name: str, table: Mapping[str, Any], p: Any) -> Any:
    return tried(name, table, p) if "module" in table else module_of(name, table).READING


def tried(name: str, table: Mapping[str, Any], p: Any) -> Any:
    """The reading of a sensor of the user's own, after one sample of it.

    Args:
        name: of the sensor.
        table: of the scene.
        p: its parameters.

    Raises:
        KeyedError: it cannot be sampled, or its types are not those that it declares.
    """
    module, where = module_of(name, table), f"sensors.{name}.module"
    key = stream_key(0, "trial", name)
    try:
        state = module.initial(p, key, Truth())
        after, reading = module.sample(p, state, key, 0, Truth())
    except Exception as error:
        said = str(error).strip().partition("\n")[0]
        raise ConfigError(where, f"{type(error).__name__}: {said}") from error
    for what, found, declared in (
        ("initial", state, module.blank()),
        ("sample's state", after, module.blank()),
        ("sample's reading", reading, module.READING),
    ):
        if numba.typeof(found) != numba.typeof(declared):
            raise ConfigError(where, f"{what} is of another type than `blank` or `READING` declares")
    return module.READING
