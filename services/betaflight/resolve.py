"""Resolution of a scene that Betaflight flies."""

from collections.abc import Mapping
from typing import NamedTuple

from lapwing.cosim.config.run_config import ServiceConfig
from lapwing.cosim.scene import Scene
from lapwing.dynamics.config_error import ConfigError
from lapwing.dynamics.geodesy import Home
from lapwing.kernels import math
from lapwing.services.betaflight.schema import Betaflight
from lapwing.services.common import ports
from lapwing.services.common.firmware.firmware_config import firmware_config
from lapwing.services.common.firmware.schema import firmware_of
from lapwing.services.common.schemas.communication_schema import Communication
from lapwing.services.common.schemas.environment_schema import environment
from lapwing.services.common.schemas.vehicle_schema import airframe, gravity, thrust_coefficient

NAME = "betaflight"
SLOWEST = 50  # [Hz] at which the firmware does not measure its clock's rate


class PilotConfig(NamedTuple):
    """Resolved values of the pilot."""

    tilt_limit_deg: float
    yaw_rate_limit_deg: float
    position_gain: float  # [1/s^2]
    velocity_gain: float  # [1/s]
    integral_gain: float  # [1/s^3]
    yaw_gain: float  # [1/s]
    hover_output: float  # motor output in hover, 0 to 1
    gravity: float  # [m/s^2]
    gps: bool  # position and velocity of the receiver, otherwise ground truth
    imu: bool  # rates and specific force of the sensor, otherwise ground truth
    barometer: bool
    home: Home


def resolve(scene: Scene) -> ServiceConfig | None:
    """Return the configuration of the adapter. Return None unless Betaflight flies the vehicle.

    Raises:
        ConfigError: no trajectory, too few ticks, or an airframe that Betaflight does not fly.
    """
    if firmware_of(scene) != NAME:
        return None
    if not scene.has("trajectory"):
        raise ConfigError("trajectory", "missing", "[[trajectory.phase]], which Betaflight's pilot flies")
    if (rate := scene[Communication].rate) <= SLOWEST:
        raise ConfigError("communication.rate", f"got {rate} Hz", f"more than {SLOWEST} Hz with Betaflight")
    sensor_names = set(scene.tables("sensors"))
    table = scene[Betaflight] if scene.has(Betaflight) else Betaflight()
    pilot = PilotConfig(
        **table.model_dump(),
        hover_output=_hover_output(scene),
        gravity=gravity(scene),
        gps=ports.GPS in sensor_names,
        imu=ports.IMU in sensor_names,
        barometer=ports.BAROMETER in sensor_names,
        home=environment(scene).home,
    )
    sensors = [name for name in (ports.IMU, ports.GPS, ports.BAROMETER) if name in sensor_names]
    return firmware_config(scene, (ports.TRUTH, *sensors), 1, pilot)


def fleet(
    shares: Mapping[str, ServiceConfig], keys: Mapping[str, str], scenes: Mapping[str, Scene]
) -> dict[str, ServiceConfig]:
    """Return the configurations by vehicle name. See `plant.resolve.fleet` for arguments.

    Raises:
        ConfigError: two vehicles have the same ports, which the firmware does not make configurable.
    """
    used: dict[tuple[str, int], str] = {}
    for name, share in shares.items():
        place = share.parameters.host, share.parameters.port
        if place in used:
            message = f"Betaflight SITL has fixed ports, which {used[place]} uses already"
            raise ConfigError(f"{keys[name]}autopilot.port", message, "one Betaflight for each host, or another port")
        used[place] = name
    return dict(shares)


def _hover_output(scene: Scene) -> float:
    """Return the motor output in hover without losses in the windings."""
    frame = airframe(scene)
    thrust = frame.mass.total * gravity(scene) / len(frame.rotors.position)
    speed = math.sqrt(thrust / thrust_coefficient(scene))
    return min(speed * frame.motor.rotor_constant / frame.motor.max_voltage, 1.0)
