"""The plant as a service: it owns time, and integrates what the scene's `vehicle.model` names."""

import importlib

from services.lockstep import Service
from services.scene import Scene
from services.sections import Vehicle


def create(scene: Scene) -> Service:
    """The plant of the scene's model: every scene has one."""
    return importlib.import_module(f"services.plant.models.{scene[Vehicle].model}").create(scene)
