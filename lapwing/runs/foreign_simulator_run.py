"""Run of Lapwing's autopilot on another simulator, which replaces plant and sensors over PX4's simulator interface."""

from typing import Any

from lapwing.cosim.config.run_config import RunConfig, ServiceConfig
from lapwing.cosim.diagram.block_diagram import Service
from lapwing.cosim.diagram.tick_schedule import InputPort, Port
from lapwing.cosim.scene import Scene
from lapwing.dynamics.config_error import ConfigError
from lapwing.kernels import python_function
from lapwing.services.common import ports
from lapwing.services.common.environment_schema import environment
from lapwing.services.common.firmware.motor_order import QUADROTOR_X, motor_order
from lapwing.services.common.vehicle_schema import airframe
from lapwing.services.process_table import create
from lapwing.services.px4.simulator_blocks import NAME, Receiver, Sender, SimulatorSetup
from lapwing.services.px4.simulator_client import SimulatorClient
from lapwing.services.px4.simulator_readings import PROVIDED
from lapwing.services.sensors import encoders, error_models, triad

TRAJECTORY = "trajectory"
REPLACED = ("plant", "sensors")  # services that the simulator replaces
_variance = python_function(error_models.sample_variance)
_deviation = python_function(error_models.white_deviation)
_NANO = 1e-9  # [T] 1 nT


def on_simulator(scene: Scene, setup: RunConfig, host: str, port: int) -> RunConfig:
    """Return the configuration of a run in which a simulator replaces plant and sensors.

    Raises:
        ConfigError: the scene needs data that the simulator's interface lacks.
    """
    if not setup.vehicle:
        raise ConfigError("vehicle", "a fleet", "a scene with one vehicle for --px4-sim")
    if "autopilot" not in setup.services:
        raise ConfigError("autopilot.firmware", "another firmware flies the vehicle", '"lapwing" for --px4-sim')
    if "sensors" not in setup.services:
        raise ConfigError("sensors", "missing", "the sensors of the simulator, [sensors.imu] and others")
    sensors = setup.services["sensors"]
    services = {name: service for name, service in setup.services.items() if name not in REPLACED}
    if TRAJECTORY in services:  # its input `truth` only keeps it at the plant's pace
        services[TRAJECTORY] = services[TRAJECTORY]._replace(inputs=())
    needed = {i.port for service in services.values() for i in service.inputs} - {
        p.name for service in services.values() for p in service.ports
    }
    if ports.TRUTH in needed:
        raise ConfigError("autopilot.estimator", "ground_truth is not in the simulator's interface", '"kalman"')
    if missing := sorted(needed - {*PROVIDED, ports.BATTERY}):
        message = f"the simulator's interface has no {', '.join(missing)}"
        raise ConfigError(f"sensors.{missing[0]}", message, f"one of {', '.join(PROVIDED)}")
    instruments = dict(zip((p.name for p in sensors.ports), sensors.parameters.instruments, strict=True))
    sensor_ports = [p for p in sensors.ports if p.name in PROVIDED]
    nominal = {p.name: _nominal(p, instruments[p.name].sensor) for p in sensor_ports}
    frame = airframe(scene)
    imu_period = next(p.period for p in sensor_ports if p.name == ports.IMU)
    timeouts = scene.lookup("autopilot.start_timeout"), scene.lookup("autopilot.step_timeout")
    simulator = SimulatorSetup(
        host, port, nominal, motor_order(frame, QUADROTOR_X, "px4"), frame.motor.max_voltage, environment(scene).home,
        setup.interval_ns, imu_period, *timeouts,
    )  # fmt: skip
    battery = Port(ports.BATTERY, ports.BatteryReading())
    services[NAME] = ServiceConfig(simulator, (InputPort(ports.ACTUATORS, 1),), (*sensor_ports, battery))
    return setup._replace(services=services)


def _nominal(port: Port, p: Any) -> Any:
    """Return the invalid reading of a sensor with the variances of its parameters."""
    blank, rate = port.like, p.rate
    if port.name == ports.IMU:
        g, a = python_function(triad.gyro_units)(p.gyro), python_function(triad.accelerometer_units)(p.accelerometer)
        omega, force = _variance(g.noise, g.resolution, rate), _variance(a.noise, a.resolution, rate)
        return blank._replace(omega_variance=omega, specific_force_variance=force)
    if port.name == ports.GPS:
        v = _deviation(p.noise_velocity_m_per_s_per_sqrt_hz, rate)
        east = _fix_variance(p.noise_horizontal_m_per_sqrt_hz, p.correlated_error_horizontal, rate)
        up = _fix_variance(p.noise_vertical_m_per_sqrt_hz, p.correlated_error_vertical, rate)
        return blank._replace(position_variance=(east, east, up), velocity_variance=v * v)
    if port.name == ports.MAGNETOMETER:
        return blank._replace(variance=_variance(p.noise_nt_per_sqrt_hz * _NANO, p.resolution_nt * _NANO, rate))
    if port.name in (ports.BAROMETER, ports.AIRSPEED):
        return blank._replace(variance=_variance(p.noise_pa_per_sqrt_hz, p.resolution_pa, rate))
    return blank._replace(variance=_variance(p.noise_m_per_sqrt_hz, p.resolution, rate))


def _fix_variance(density: float, correlated: float, rate: float) -> float:
    return float(_deviation(density, rate) ** 2 + correlated * correlated)


def services(setup: RunConfig) -> list[Service]:
    """Return the services of a run on a simulator, in their order."""
    config = setup.services[NAME]
    own: SimulatorSetup = config.parameters
    client = SimulatorClient(own.host, own.port)
    receiver = Receiver(own, client, config.ports)
    first = Service(f"{NAME}.receive", [receiver], encoders.topic_encoders(setup, None, encoders.GpsEncoding()))
    last = Service(f"{NAME}.send", [Sender(own, client, receiver)], [])
    return [first, *(create(setup, name) for name in setup.order if name != NAME), last]
