"""Resolution of a scene's `[autopilot]` into the service's configuration."""

import math
from collections.abc import Callable

from lapwing.cosim.config.run_config import ServiceConfig
from lapwing.cosim.diagram.tick_schedule import InputPort, Port
from lapwing.cosim.scene import Scene
from lapwing.dynamics.config_error import ConfigError
from lapwing.dynamics.terrain import Level, surface
from lapwing.services.autopilot import estimator
from lapwing.services.autopilot.custom.user_code_loader import controller_rate, estimator_rate, vehicle_model
from lapwing.services.autopilot.estimator import Estimator
from lapwing.services.autopilot.estimator.filter_parameters import NO_STATIC_PRESSURE_ERROR
from lapwing.services.autopilot.gains import GainSet
from lapwing.services.autopilot.land_detector import Thresholds
from lapwing.services.autopilot.nominal_airframe import known_airframe
from lapwing.services.autopilot.schema import ESTIMATORS, Autopilot, distance_sensor
from lapwing.services.autopilot.service_config import AutopilotConfig, CustomCode
from lapwing.services.common import autopilot_parameters, ports, user_modules
from lapwing.services.common.firmware.schema import flown_by_firmware
from lapwing.services.common.ports import AutopilotStatus, EstimateCovariance, MotorCommand, Setpoint, StateEstimate
from lapwing.services.common.schemas.communication_schema import Communication, Rates, ticks
from lapwing.services.common.schemas.environment_schema import environment, known_magnetic_field
from lapwing.services.common.schemas.run_schema import follows_trajectory
from lapwing.services.common.schemas.vehicle_schema import gravity, start_place

FUSED = (ports.IMU, ports.MAGNETOMETER, ports.BAROMETER, ports.GPS, ports.SONAR, ports.RANGEFINDER, ports.OPTICAL_FLOW)


def resolve(scene: Scene) -> ServiceConfig | None:
    """Return the configuration of the autopilot. Return None if the scene has no `[autopilot]` or another firmware."""
    if not scene.has(Autopilot) or flown_by_firmware(scene):
        return None
    settings, exchange, rates = scene[Autopilot], scene[Communication], scene[Rates]
    follows = follows_trajectory(scene)
    exact, user_code = settings.estimator == "ground_truth", settings.estimator not in ESTIMATORS
    installed = sorted(scene.tables("sensors"))
    sensors = [name for name in FUSED if name in installed and not exact and not user_code]
    if ports.RANGEFINDER in sensors and distance_sensor(scene) != ports.RANGEFINDER:
        sensors.remove(ports.RANGEFINDER)
    inputs = [InputPort(ports.TRUTH)] if exact else [InputPort(name) for name in (installed if user_code else sensors)]
    gyro_range = math.radians(scene.lookup("sensors.imu.gyro").range_dps) if ports.IMU in sensors else math.inf
    for name in (ports.GPS, ports.MAGNETOMETER):
        if name in sensors and scene.lookup(f"sensors.{name}.instances") > 1:
            raise ConfigError(f"sensors.{name}.instances", "Lapwing's autopilot uses one", "1, or a firmware with more")
    imus = scene.lookup("sensors.imu.instances") if ports.IMU in sensors else 1
    inputs += [InputPort(name) for name in ports.IMUS[1:imus]]
    if ports.AIRSPEED in installed and settings.accept_commands and not user_code:
        inputs.append(InputPort(ports.AIRSPEED))  # published for the operator only
    inputs += [InputPort(ports.BATTERY), *([InputPort(ports.TRAJECTORY)] if follows else [])]
    every = {name: ticks(scene, scene.lookup(f"sensors.{name}.rate"), name) for name in sensors}
    imu_every = every.get(ports.IMU, 1)
    config = AutopilotConfig(
        estimator=None if exact or user_code else _estimator(scene, imu_every),
        start_world=start_place(scene),
        imu_every=imu_every,
        gps_age=_gps_delay(scene, imu_every) if ports.GPS in sensors else 0,
        gains=scene[GainSet].plain(),
        geometric=settings.attitude_error == "so3",
        airframe=known_airframe(scene),
        parameters=tuple(autopilot_parameters.table(scene).values()),
        phases=tuple(phase.name for phase in scene.lookup("trajectory.phase")) if follows else (),
        operator=settings.accept_commands,
        estimate_every=ticks(scene, min(rates.estimate, exchange.rate), "rates.estimate"),
        status_every=ticks(scene, min(rates.status, exchange.rate), "rates.status"),
        answers_every=ticks(scene, min(rates.commands, exchange.rate), "rates.commands"),
        controller=_custom(scene, "controller", controller_rate) if settings.controller else None,
        own_estimator=_custom(scene, "estimator", estimator_rate) if user_code else None,
        vehicle=vehicle_model(known_airframe(scene), exchange.interval) if settings.controller or user_code else None,
        imus=imus,
        distance_sensor=distance_sensor(scene),
        landing=Thresholds(**settings.landing.model_dump()),
        gyro_range=gyro_range,
    )
    no_voltage = (0.0,) * len(config.airframe.rotor_x)
    return ServiceConfig(
        config,
        tuple(inputs),
        (
            Port(ports.ACTUATORS, MotorCommand(no_voltage, False, no_voltage, (0.0, 0.0, 0.0))),
            Port(ports.ESTIMATE, StateEstimate()),
            Port(ports.SETPOINT, Setpoint()),
            Port(ports.STATUS, AutopilotStatus()),
            *([] if exact or user_code else [_covariance(scene)]),
        ),
    )


def _covariance(scene: Scene) -> Port:
    every = ticks(scene, min(scene[Rates].covariance, scene[Communication].rate), "rates.covariance")
    return Port(ports.ESTIMATE_COVARIANCE, EstimateCovariance(), every)


def _custom(scene: Scene, key: str, rate: Callable[..., float]) -> CustomCode:
    """Return the user code that the key names, after a trial step."""
    config, vehicle = scene[Autopilot], vehicle_model(known_airframe(scene), scene[Communication].interval)
    name, options = getattr(config, key), dict(getattr(config, f"{key}_options"))
    code_rate = rate(name, user_modules.texts(scene), vehicle, options)
    return CustomCode(name, options, ticks(scene, code_rate, f"autopilot.{key}"))


def _estimator(scene: Scene, imu_every: int) -> Estimator:
    receiver = scene.tables("sensors")["gps"].get("preset", "rtk")
    surroundings, preset = environment(scene), estimator.PRESETS.get(receiver, Estimator())
    level = isinstance(surroundings.terrain, Level)
    ground = surface(surroundings.terrain, *start_place(scene)[:2])[0]
    if distance_sensor(scene) == ports.RANGEFINDER:
        preset = preset._replace(sonar_half_beam_deg=0.5 * scene.lookup("sensors.rangefinder.beam_deg"))
        ground -= scene.lookup("sensors.rangefinder.position")[2]  # origin of the distance
    if ports.BAROMETER in scene.tables("sensors"):
        error = scene.lookup("sensors.barometer.static_pressure_error")
        preset = preset._replace(static_pressure_error=tuple(error or NO_STATIC_PRESSURE_ERROR))
    return preset._replace(
        interval=scene[Communication].interval * imu_every,
        home=surroundings.home,
        gravity=gravity(scene),
        atmosphere=surroundings.atmosphere,
        magnetic_field_world=known_magnetic_field(scene),
        ground_height=ground,
        wind_speed=scene[Autopilot].expected_wind_speed,
        sonar_height_max=preset.sonar_height_max if level else 0.0,  # the filter assumes level ground
    )


def _gps_delay(scene: Scene, imu_every: int) -> int:
    """Return the delay of the receiver in IMU readings."""
    delay = scene.lookup("sensors.gps.latency_samples") / scene.lookup("sensors.gps.rate")
    return round(round(delay * 1e9) / scene[Communication].interval_ns / imu_every)
