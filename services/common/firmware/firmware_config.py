"""Resolved configuration of a firmware adapter."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from lapwing.cosim.config.run_config import ServiceConfig
from lapwing.cosim.diagram.tick_schedule import InputPort, Port
from lapwing.cosim.scene import Scene
from lapwing.services.common import ports
from lapwing.services.common.firmware.motor_order import motors
from lapwing.services.common.firmware.schema import TABLE, FirmwareKeys
from lapwing.services.common.ports import AutopilotStatus, MotorCommand, Setpoint
from lapwing.services.common.schemas.communication_schema import Communication, Rates, ticks
from lapwing.services.common.schemas.run_schema import follows_trajectory
from lapwing.services.common.schemas.vehicle_schema import airframe, start_place


class FirmwareConfig(NamedTuple):
    """Configuration of the adapter of one vehicle."""

    firmware: str
    command: list[str]  # empty: wait for a program that is started elsewhere
    directory: str | None  # working directory; None: a temporary one
    environment: dict[str, str]
    host: str
    port: int | None  # first port of its links; None: the firmware's default, shifted by the instance
    instance: int | None  # from 0; None: number of the vehicle
    start_timeout: float  # [s]
    step_timeout: float  # [s]
    repeatable: bool  # the library `repeatable.c` orders the program's threads
    schedule: int  # seed of this order
    shell: bool  # the program has the standard input and output of this process
    parameters: dict[str, float]  # firmware parameters by name
    parameter_text: str  # content of the parameter file
    chooses: bool  # another instance is used if the ports of this one are in use
    order: tuple[int, ...]  # firmware output that drives each rotor of the airframe
    voltage_max: float  # [V] at output 1 if no effect models the battery
    start_world: tuple[float, float, float]  # [m] start position
    interval: float  # [s] length of a tick
    interval_ns: int
    period: int  # [ticks] between two exchanges
    status_every: int  # [ticks]
    phases: tuple[str, ...]  # phases of the scene's trajectory; empty if the firmware flies a plan
    plan: tuple[Any, ...]  # operator commands of `--plan`; a mission_upload has the items
    own: Any  # the adapter's own values

    def port_at(self, default: int, stride: int = 1) -> int:
        """Return the first port: the scene's, or the firmware's default shifted by the instance."""
        return self.port or default + stride * (self.instance or 0)


def firmware_config(scene: Scene, inputs: tuple[str, ...], period: int, own: Any) -> ServiceConfig:
    """Return the configuration of an adapter.

    Args:
        scene: resolved scene whose `autopilot.firmware` is the adapter's.
        inputs: ports that the firmware consumes, without the battery and the trajectory, which every adapter gets.
        period: [ticks] between two exchanges.
        own: the adapter's own resolved values, a NamedTuple.

    Raises:
        ConfigError: the airframe's rotors do not match the firmware's outputs.
    """
    table, frame, exchange = scene.section(TABLE), airframe(scene), scene[Communication]
    follows = follows_trajectory(scene)
    config = FirmwareConfig(
        **{name: getattr(table, name) for name in (*FirmwareKeys.model_fields, "parameters")},
        chooses=bool(table.command) and table.instance is None and table.port is None,
        order=motors(scene).order,
        voltage_max=frame.motor.max_voltage,
        start_world=start_place(scene),
        interval=exchange.interval,
        interval_ns=exchange.interval_ns,
        period=period,
        status_every=ticks(scene, min(scene[Rates].status, exchange.rate), "rates.status"),
        phases=tuple(phase.name for phase in scene.lookup("trajectory.phase")) if follows else (),
        plan=(),
        own=own,
    )
    names = [*inputs, ports.BATTERY, *([ports.TRAJECTORY] if follows else [])]
    none = (0.0,) * len(config.order)
    outputs = [
        Port(ports.ACTUATORS, MotorCommand(none, False, none, (0.0, 0.0, 0.0))),
        Port(ports.STATUS, AutopilotStatus()),
        *([Port(ports.SETPOINT, Setpoint())] if follows else []),
    ]
    return ServiceConfig(config, tuple(InputPort(name) for name in dict.fromkeys(names)), tuple(outputs))


def latencies(scene: Scene, parameters: Mapping[str, Sequence[str]]) -> dict[str, float]:
    """Return the firmware's `parameters` of each sensor that the scene has: age [ms] of the readings that it gets."""
    result: dict[str, float] = {}
    for sensor in filter(scene.tables("sensors").__contains__, parameters):
        age = scene.lookup(f"sensors.{sensor}.latency_samples") / scene.lookup(f"sensors.{sensor}.rate")
        result |= dict.fromkeys(parameters[sensor], 1e3 * float(age))
    return result


def fleet(
    shares: Mapping[str, ServiceConfig], keys: Mapping[str, str], scenes: Mapping[str, Scene]
) -> dict[str, ServiceConfig]:
    """Return the configurations by vehicle name, with an instance for each that has none.

    See `plant.resolve.fleet` for arguments.
    """
    names = list(keys)
    return {
        name: share._replace(parameters=share.parameters._replace(instance=names.index(name)))
        if share.parameters.instance is None
        else share
        for name, share in shares.items()
    }
