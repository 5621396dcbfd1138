"""The process table: every process of a run, and when it is wanted.

A service of the lock step has `resolve(scene)` in `resolve.py`, which gives its `ServiceSetup`, or None where the scene
does not call for it, and `create(setup)` in `service.py`; any other has `run(process, participation)` in `service.py`,
and a `resolve(scene)` too where it has to know of the scene.
"""

import importlib
from collections.abc import Callable, Iterable, Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.diagram.block_diagram import Service
from lapwing.cosim.diagram.multi_vehicle import joined_service, members
from lapwing.cosim.transport.bus_keys import ENCODER


class ProcessEntry(NamedTuple):
    """A process of a run."""

    name: str
    package: str  # folder of its code
    lock_step: bool  # steps with the others; wanted where the set-up has it
    resolves: bool = False  # has a `resolve.py` although it is no part of the lock step
    needs: tuple[str, ...] = ()  # what it is given besides the set-up
    optional: bool = False  # wanted only where its option is given, and the run goes on without it
    mode: str = "peer"  # of its Zenoh session


PROCESSES = (
    ProcessEntry("plant", "lapwing.services.plant", True),
    ProcessEntry("sensors", "lapwing.services.sensors", True),
    ProcessEntry("autopilot", "lapwing.services.autopilot", True),
    ProcessEntry("trajectory", "lapwing.services.trajectory", True),
    ProcessEntry("formation", "lapwing.services.formation", True),
    ProcessEntry("recorder", "lapwing.services.recorder", False, needs=("log",)),
    ProcessEntry("router", "lapwing.services.router", False, needs=("open",), optional=True, mode="router"),
    ProcessEntry("mavlink", "lapwing.services.mavlink", False, resolves=True, needs=("mavlink",), optional=True),
    ProcessEntry("foxglove", "lapwing.services.foxglove", False, needs=("foxglove",), optional=True),
    ProcessEntry("ros2", "lapwing.services.ros2", False, needs=("ros2",), optional=True),
)
RECORDER, ROUTER, MAVLINK, FOXGLOVE, ROS2 = "recorder", "router", "mavlink", "foxglove", "ros2"
CLOCK_OWNER = "plant"  # keeps the pace, and says which tick is the last


def entry(name: str) -> ProcessEntry:
    """The entry of a name.

    Raises:
        ValueError: there is none; names the choices.
    """
    for process in PROCESSES:
        if process.name == name:
            return process
    raise ValueError(f"unknown service {name}; expected one of {', '.join(p.name for p in PROCESSES)}")


def needed(setup: RunConfig, external: Iterable[str] = ()) -> list[str]:
    """The processes without which a run cannot go on; a service in `external` is a program of somebody else's."""
    own = [p.name for p in PROCESSES if (p.name in setup.services if p.lock_step else not p.optional)]
    return own + [f"{name}{ENCODER}" for name in external]


def usual() -> list[str]:
    """The processes that a run may need whatever its options are."""
    return [p.name for p in PROCESSES if not p.optional]


def optional() -> list[str]:
    """Return the names of the auxiliary processes, which a run has if an option asks for them."""
    return [p.name for p in PROCESSES if p.optional]


def encoded(name: str) -> str:
    """The service whose messages the process of this name makes, "" for any other process."""
    return name.removesuffix(ENCODER) if name.endswith(ENCODER) else ""


Operator = Callable[[int], Iterable[Any]]  # gives the commands that have come until a tick, besides those of the plan


def create(setup: RunConfig, name: str, operators: Mapping[str, Operator] = MappingProxyType({})) -> Service:
    """A service of the lock step of a run; `operators` give the commands of each vehicle, by its name."""
    module = importlib.import_module(f"{entry(name).package}.service")

    def of(member: RunConfig) -> Service:
        own = {"operator": operators[member.vehicle]} if name == "autopilot" and member.vehicle in operators else {}
        return module.create(member, **own)

    if setup.vehicle:
        return of(setup)
    having = [member for member in members(setup) if name in member.services]
    return joined_service(name, [(member, of(member)) for member in having])


def create_all(setup: RunConfig, operator: Operator | Mapping[str, Operator] | None = None) -> list[Service]:
    """All services of the lock step of a run, in their order of execution.

    Args:
        setup: the run.
        operator: gives commands to the vehicle, or one for each by the vehicle's name.
    """
    if operator is None:
        operator = {}
    operators = operator if isinstance(operator, Mapping) else {setup.vehicle: operator}
    return [create(setup, name, operators) for name in setup.order]
