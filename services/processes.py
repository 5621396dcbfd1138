"""The process table: every process of a run, and when it is wanted.

A service of the lock step has `resolve(scene)` in `resolve.py`, which gives its `ServiceSetup`, or None where the scene
does not call for it, and `create(setup)` in `service.py`; any other has `run(process, participation)` in `service.py`,
and a `resolve(scene)` too where it has to know of the scene.
"""

import importlib
from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

from cosim.graph import Service
from cosim.setup import Setup


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
    ProcessEntry("plant", "services.plant", True),
    ProcessEntry("sensors", "services.sensors", True),
    ProcessEntry("autopilot", "services.autopilot", True),
    ProcessEntry("trajectory", "services.trajectory", True),
    ProcessEntry("formation", "services.formation", True),
    ProcessEntry("recorder", "services.recorder", False, needs=("log",)),
    ProcessEntry("router", "services.router", False, needs=("open",), optional=True, mode="router"),
    ProcessEntry("mavlink", "services.mavlink", False, resolves=True, needs=("mavlink",), optional=True),
)
RECORDER, ROUTER, MAVLINK = "recorder", "router", "mavlink"
ENCODER = "_messages"  # ending of the name of a process that makes the messages of a program of somebody else's
TIME_OWNER = "plant"  # keeps the pace, and says which tick is the last


def entry(name: str) -> ProcessEntry:
    """The entry of a name.

    Raises:
        ValueError: there is none; names the choices.
    """
    for process in PROCESSES:
        if process.name == name:
            return process
    raise ValueError(f"unknown service {name}; expected one of {', '.join(p.name for p in PROCESSES)}")


def needed(setup: Setup, external: Iterable[str] = ()) -> list[str]:
    """The processes without which a run cannot go on; a service in `external` is a program of somebody else's."""
    own = [p.name for p in PROCESSES if (p.name in setup.services if p.lock_step else not p.optional)]
    return own + [f"{name}{ENCODER}" for name in external]


def encoded(name: str) -> str:
    """The service whose messages the process of this name makes, "" for any other process."""
    return name.removesuffix(ENCODER) if name.endswith(ENCODER) else ""


def create(setup: Setup, name: str, **more: Any) -> Service:
    """A service of the lock step of a run."""
    return importlib.import_module(f"{entry(name).package}.service").create(setup, **more)


def create_all(setup: Setup, operator: Callable | None = None) -> list[Service]:
    """All services of the lock step of a run, in their order of execution.

    Args:
        setup: the run.
        operator: gives the commands that have come until a tick, besides those of the plan.
    """
    more: dict[str, Any] = {"autopilot": {"operator": operator}} if operator else {}
    return [create(setup, name, **more.get(name, {})) for name in setup.order]
