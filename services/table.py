"""The process table: which services there are, and which of them a scene calls for.

A service is a folder with a `service.py`. One that takes part in the lock step defines `create(scene)`, which gives
its `Service`, or None where the scene does not call for it; any other defines `run(process, ...)`.
"""

import importlib
import importlib.util
import pkgutil
from functools import cache
from types import ModuleType

import services
from services.lockstep import Service
from services.scene import Scene

RECORDER, ROUTER, MAVLINK = "recorder", "router", "mavlink"  # the services that take no part in the lock step


@cache
def modules() -> dict[str, ModuleType]:
    """The `service` module of every service folder, by folder name."""
    names = [p.name for p in pkgutil.iter_modules(services.__path__) if p.ispkg]
    return {
        name: importlib.import_module(f"services.{name}.service")
        for name in sorted(names)
        if importlib.util.find_spec(f"services.{name}.service")
    }


def lockstep_services(scene: Scene) -> dict[str, Service]:
    """The services that fly this scene, by name."""
    created = {name: module.create(scene) for name, module in modules().items() if hasattr(module, "create")}
    return {name: service for name, service in created.items() if service is not None}
