"""Resolved configuration of a firmware adapter."""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple, TypeVar

from lapwing.cosim.config.run_config import ServiceConfig
from lapwing.cosim.diagram.tick_schedule import InputPort, Port
from lapwing.cosim.run_errors import LockStepError
from lapwing.cosim.scene import Scene
from lapwing.services.common import ports
from lapwing.services.common.communication_schema import Communication, Rates, ticks
from lapwing.services.common.firmware.motor_order import QUADROTOR_X, motor_order
from lapwing.services.common.firmware.schema import TABLE
from lapwing.services.common.ports import AutopilotStatus, MotorCommand, Setpoint
from lapwing.services.common.run_schema import follows_trajectory
from lapwing.services.common.vehicle_schema import airframe, start_place

T = TypeVar("T")


class FirmwareSetup(NamedTuple):
    """Configuration of the adapter of one vehicle."""

    firmware: str
    command: tuple[str, ...]  # empty: wait for a program that is started elsewhere
    directory: str  # working directory; "": a temporary one
    environment: dict[str, str]
    host: str
    port: int  # first port of its links; 0: the firmware's default, shifted by the instance
    instance: int  # from 0; -1: number of the vehicle
    chooses: bool  # another instance is used if the ports of this one are in use
    start_timeout: float  # [s]
    step_timeout: float  # [s]
    parameters: dict[str, float]  # firmware parameters by name
    parameter_text: str  # content of the parameter file
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
        return self.port or default + stride * max(self.instance, 0)


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
    setup = FirmwareSetup(
        table.firmware,
        tuple(table.command),
        table.directory or "",
        dict(table.environment),
        table.host,
        table.port or 0,
        -1 if table.instance is None else table.instance,
        bool(table.command) and table.instance is None and table.port is None,
        table.start_timeout,
        table.step_timeout,
        dict(table.parameters),
        table.parameter_text,
        motor_order(frame, QUADROTOR_X, table.firmware),
        frame.motor.max_voltage,
        start_place(scene),
        exchange.interval,
        exchange.interval_ns,
        period,
        ticks(scene, min(scene[Rates].status, exchange.rate), "rates.status"),
        tuple(phase.name for phase in scene.lookup("trajectory.phase")) if follows else (),
        (),
        own,
    )
    names = [*inputs, ports.BATTERY, *([ports.TRAJECTORY] if follows else [])]
    none = (0.0,) * len(setup.order)
    outputs = [
        Port(ports.ACTUATORS, MotorCommand(none, False, none, (0.0, 0.0, 0.0))),
        Port(ports.STATUS, AutopilotStatus(), setup.status_every),
        *([Port(ports.SETPOINT, Setpoint())] if follows else []),
    ]
    return ServiceConfig(setup, tuple(InputPort(name) for name in dict.fromkeys(names)), tuple(outputs))


def fleet(
    shares: Mapping[str, ServiceConfig], keys: Mapping[str, str], scenes: Mapping[str, Scene]
) -> dict[str, ServiceConfig]:
    """Return the configurations by vehicle name, with an instance for each that has none.

    See `plant.resolve.fleet` for arguments.
    """
    names = list(keys)
    return {
        name: share._replace(parameters=share.parameters._replace(instance=names.index(name)))
        if share.parameters.instance < 0
        else share
        for name, share in shares.items()
    }


def first_free(setup: FirmwareSetup, count: int, claim: Callable[[FirmwareSetup], T]) -> tuple[FirmwareSetup, T]:
    """Return the configuration with the first instance whose ports are free, and the result of `claim`.

    Runs side by side, as in a campaign, thus get different instances.

    Args:
        setup: configuration; its instance is the first that is tried, and the only one unless it `chooses`.
        count: instances from 0 that the firmware can have.
        claim: opens the ports of a configuration.

    Raises:
        LockStepError: from `claim`, for the last instance.
    """
    first = max(setup.instance, 0)
    for instance in range(first, max(count, first + 1)):
        candidate = setup._replace(instance=instance)
        try:
            return candidate, claim(candidate)
        except LockStepError:
            if not setup.chooses or instance + 1 >= count:
                raise
    raise AssertionError("unreachable")
