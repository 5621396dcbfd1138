"""Process table: every process of a run, and when it is required.

A service of the lock step has `resolve(scene)` in `resolve.py`, which returns its `ServiceConfig`, or None if the scene
does not need it, and `create(config)` in `service.py`. An FMU of the scene is a service `NAME_fmu` each, with the entry
`fmu`. Any other process has `run(participant, spec)` in `service.py`,
and `resolve(scene)` if it reads the scene (`lapwing.services.scene_resolver`).
"""

from collections.abc import Callable, Iterable, Mapping
from types import MappingProxyType, ModuleType
from typing import Any, NamedTuple

from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.diagram.block_diagram import Service
from lapwing.cosim.diagram.multi_vehicle import members, merge_services
from lapwing.cosim.transport.bus_keys import ENCODER
from lapwing.fmi.importer.service_config import fmus_of, replaced_ports, rewire
from lapwing.services.common.foreign_code import FMU_SUFFIX


class ProcessEntry(NamedTuple):
    """Process of a run."""

    name: str
    lock_step: bool  # part of the lock step; required if the run configuration has it
    resolves: bool = False  # has a `resolve.py` although it is not part of the lock step
    optional: bool = False  # started only if its option is given; the run continues without it
    mode: str = "peer"  # mode of its Zenoh session
    foreign: bool = False  # flies a foreign firmware instead of the autopilot

    def service(self) -> ModuleType:
        """Import and return the module with `create` or `run`; a process loads only its own."""
        match self.name:
            case "plant":
                from lapwing.services.plant import service as plant

                return plant
            case "sensors":
                from lapwing.services.sensors import service as sensors

                return sensors
            case "autopilot":
                from lapwing.services.autopilot import service as autopilot

                return autopilot
            case "betaflight":
                from lapwing.services.betaflight import link as betaflight

                return betaflight
            case "ardupilot":
                from lapwing.services.ardupilot import link as ardupilot

                return ardupilot
            case "px4":
                from lapwing.services.px4 import link as px4

                return px4
            case "trajectory":
                from lapwing.services.trajectory import service as trajectory

                return trajectory
            case "formation":
                from lapwing.services.formation import service as formation

                return formation
            case "fmu":
                from lapwing.fmi.importer import service as fmu

                return fmu
            case "recorder":
                from lapwing.services.recorder import service as recorder

                return recorder
            case "router":
                from lapwing.services.router import service as router

                return router
            case "mavlink":
                from lapwing.services.mavlink import service as mavlink

                return mavlink
            case "foxglove":
                from lapwing.services.foxglove import service as foxglove

                return foxglove
            case "ros2":
                from lapwing.services.ros2 import service as ros2

                return ros2
        raise AssertionError(self.name)


PROCESSES = (
    ProcessEntry("plant", True),
    ProcessEntry("sensors", True),
    ProcessEntry("autopilot", True),
    ProcessEntry("px4", True, foreign=True),
    ProcessEntry("ardupilot", True, foreign=True),
    ProcessEntry("betaflight", True, foreign=True),
    ProcessEntry("trajectory", True),
    ProcessEntry("formation", True),
    ProcessEntry("fmu", True),
    ProcessEntry("recorder", False),
    ProcessEntry("router", False, optional=True, mode="router"),
    ProcessEntry("mavlink", False, resolves=True, optional=True),
    ProcessEntry("foxglove", False, optional=True),
    ProcessEntry("ros2", False, optional=True),
)
AUTOPILOT, FMU = "autopilot", "fmu"
RECORDER, ROUTER, MAVLINK, FOXGLOVE, ROS2 = "recorder", "router", "mavlink", "foxglove", "ros2"
CLOCK_OWNER = "plant"  # sets the pace, and decides which tick is the last


def entry(name: str) -> ProcessEntry:
    """Return the entry of a process.

    Raises:
        ValueError: unknown name; the text lists the choices.
    """
    for process in PROCESSES:
        if process.name == (FMU if name.endswith(FMU_SUFFIX) else name):
            return process
    raise ValueError(f"unknown service {name}; expected one of {', '.join(p.name for p in PROCESSES)}")


def required_processes(config: RunConfig, external: Iterable[str] = ()) -> list[str]:
    """Return the names of the processes that a run requires, with an encoder for each service in `external`."""
    own = [p.name for p in PROCESSES if (p.name in config.services if p.lock_step else not p.optional)]
    own += [name for name in config.services if entry(name).name == FMU]
    return own + [f"{name}{ENCODER}" for name in external]


def always_required() -> list[str]:
    """Return the names of the processes that a run may need without any option."""
    return [p.name for p in PROCESSES if not (p.optional or p.foreign or p.name == FMU)]


def certificate_name(name: str) -> str:
    """Return the name in the certificate of a participant; the FMUs of all scenes share one."""
    service = service_of_encoder(name) or name
    return (FMU if service.endswith(FMU_SUFFIX) else service) + name.removeprefix(service)


def optional() -> list[str]:
    """Return the names of the auxiliary processes, which options add to a run."""
    return [p.name for p in PROCESSES if p.optional]


def foreign_firmware(config: RunConfig) -> str:
    """Return the names of the foreign firmwares that fly in a run, "" for Lapwing's own autopilot."""
    return ", ".join(p.name for p in PROCESSES if p.foreign and p.name in config.services)


def service_of_encoder(name: str) -> str:
    """Return the service whose messages an encoder process encodes, "" for any other process."""
    return name.removesuffix(ENCODER) if name.endswith(ENCODER) else ""


Operator = Callable[[int], Iterable[Any]]  # returns the commands received until a tick, besides those of the plan


def create(
    config: RunConfig,
    name: str,
    operators: Mapping[str, Operator] = MappingProxyType({}),
    recorded: Mapping[str, Any] = MappingProxyType({}),
) -> Service:
    """Create a service of the lock step.

    Args:
        config: configuration of the run.
        name: name of the service.
        operators: by vehicle name; return the external commands up to a tick.
        recorded: by vehicle name, messages of a foreign firmware to fly again (`firmware.playback.Recorded`).
    """
    module = entry(name).service()

    def create_member(member: RunConfig) -> Service:
        own: dict[str, Any] = {}
        if name == AUTOPILOT and member.vehicle in operators:
            own = {"operator": operators[member.vehicle]}
        elif entry(name).foreign and member.vehicle in recorded:
            own = {"recorded": recorded[member.vehicle]}
        elif entry(name).name == FMU:
            own = {"name": name}
        service = module.create(member, **own)
        own_ports = {port.name for port in member.services[name].ports}
        replaced = {a: b for a, b in replaced_ports(fmus_of(member.services)).items() if a not in own_ports}
        if replaced and entry(name).name != FMU:
            service.blocks = rewire(service.blocks, replaced)
        return service

    if config.vehicle:
        return create_member(config)
    users = [member for member in members(config) if name in member.services]
    return merge_services(name, [(member, create_member(member)) for member in users])


def create_all(
    config: RunConfig,
    operator: Operator | Mapping[str, Operator] | None = None,
    recorded: Mapping[str, Any] = MappingProxyType({}),
) -> list[Service]:
    """Create all services of the lock step, in their order of execution.

    Args:
        config: configuration of the run.
        operator: returns the external commands up to a tick; a mapping by vehicle name for several vehicles.
        recorded: see `create`.
    """
    if operator is None:
        operator = {}
    operators = operator if isinstance(operator, Mapping) else {config.vehicle: operator}
    return [create(config, name, operators, recorded) for name in config.order]
