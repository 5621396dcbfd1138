"""From a scene's `[autopilot]` to what the autopilot is given."""

import math
from collections.abc import Callable

from cosim.scene import Scene
from cosim.schedule import Input, Port
from cosim.setup import ServiceSetup
from dynamics.vehicles.multirotor import STANDARD_DENSITY
from services.autopilot import estimator
from services.autopilot.config import ESTIMATORS, Autopilot
from services.autopilot.custom.build import controller_rate, estimator_rate, vehicle_model
from services.autopilot.estimate import EXACT
from services.autopilot.estimator import Estimator
from services.autopilot.gains import GainSet
from services.autopilot.law import Airframe
from services.autopilot.motor import Motor
from services.autopilot.setup import AutopilotSetup, CustomCode
from services.common import modules, parameters, ports
from services.common.exchange import Exchange, Rates, ticks
from services.common.ports import AutopilotStatus, MotorCommand, Reference
from services.common.sections import follows_trajectory
from services.common.vehicle import Effects, airframe, gravity, rotor_constants, start_height

FUSED = (ports.IMU, ports.MAGNETOMETER, ports.BAROMETER, ports.GPS, ports.SONAR)


def resolve(scene: Scene) -> ServiceSetup | None:
    """The autopilot of the scene; None where there is none."""
    if not scene.has(Autopilot):
        return None
    config, exchange, rates = scene[Autopilot], scene[Exchange], scene[Rates]
    follows = follows_trajectory(scene)
    truth, own = config.estimator == "truth", config.estimator not in ESTIMATORS
    carried = sorted(scene.tables("sensors"))
    sensors = [name for name in FUSED if name in carried and not truth and not own]
    inputs = [Input(ports.TRUTH)] if truth else [Input(name) for name in (carried if own else sensors)]
    inputs += [Input(ports.BATTERY), *([Input(ports.TRAJECTORY)] if follows else [])]
    every = {name: ticks(scene, scene.lookup(f"sensors.{name}.rate"), name) for name in sensors}
    imu_every = every.get(ports.IMU, 1)
    given = AutopilotSetup(
        None if truth or own else _estimator(scene, imu_every),
        (0.0, 0.0, start_height(scene)),
        imu_every,
        _lateness(scene, imu_every) if ports.GPS in sensors else 0,
        scene[GainSet].plain(),
        config.attitude == "so3",
        known_airframe(scene),
        tuple(parameters.table(scene).values()),
        _phases(scene) if follows else (),
        config.operator,
        (),
        ticks(scene, min(rates.estimate, exchange.rate), "rates.estimate"),
        ticks(scene, min(rates.status, exchange.rate), "rates.status"),
        ticks(scene, min(rates.operator, exchange.rate), "rates.operator"),
        _custom(scene, "controller", controller_rate) if config.controller else None,
        _custom(scene, "estimator", estimator_rate) if own else None,
        vehicle_model(known_airframe(scene), exchange.interval) if config.controller or own else None,
    )
    four = (0.0,) * 4
    return ServiceSetup(
        given,
        tuple(inputs),
        (
            Port(ports.ACTUATORS, MotorCommand(four, False, four, (0.0, 0.0, 0.0))),
            Port(ports.ESTIMATE, EXACT),
            Port(ports.SETPOINT, Reference()),
            Port(ports.STATUS, AutopilotStatus(), given.status_every),
        ),
    )


def _phases(scene: Scene) -> tuple[str, ...]:
    return tuple(phase.name for phase in scene.lookup("trajectory.phase"))


def _custom(scene: Scene, key: str, rate: Callable[..., float]) -> CustomCode:
    """The code that the key names, tried."""
    config, vehicle = scene[Autopilot], vehicle_model(known_airframe(scene), scene[Exchange].interval)
    name, options = getattr(config, key), dict(getattr(config, f"{key}_options"))
    found = rate(name, modules.texts(scene), vehicle, options)
    return CustomCode(name, options, ticks(scene, found, f"autopilot.{key}"))


def _estimator(scene: Scene, imu_every: int) -> Estimator:
    receiver = scene.tables("sensors")["gps"].get("preset", "rtk")
    return estimator.PRESETS.get(receiver, Estimator())._replace(
        interval=scene[Exchange].interval * imu_every, gravity=gravity(scene)
    )


def _lateness(scene: Scene, imu_every: int) -> int:
    """Readings of the IMU by which the receiver is late."""
    late = scene.lookup("sensors.gps.latency_samples") / scene.lookup("sensors.gps.rate")
    return round(round(late * 1e9) / scene[Exchange].interval_ns / imu_every)


def known_airframe(scene: Scene) -> Airframe:
    """What the autopilot is told of the vehicle: nominal numbers, at standard density."""
    frame = airframe(scene)
    rotor = rotor_constants(scene)
    torque_per_thrust = rotor.torque / rotor.thrust
    thrust_coefficient = (STANDARD_DENSITY if rotor.with_density else 1.0) * rotor.thrust
    weight = 0.25 * frame.mass.total * gravity(scene)
    slope = 2.0 * math.sqrt(weight * thrust_coefficient)  # [N s/rad] of a rotor in hover
    spins_up = "gyroscopic_torque" in scene[Effects].tables and slope > 0.0
    x, y, _ = zip(*frame.rotors.position, strict=True)
    a, b, c, d = frame.rotors.reaction_sign
    engine = frame.motor
    return Airframe(
        frame.mass.total,
        frame.mass.inertia,
        x,
        y,
        (a, b, c, d),
        torque_per_thrust,
        Motor(thrust_coefficient, engine.gear_ratio, engine.speed_constant, engine.time_constant),
        engine.max_voltage,
        start_height(scene),
        gravity(scene),
        frame.rotors.inertia / (slope * torque_per_thrust) if spins_up else 0.0,
    )
