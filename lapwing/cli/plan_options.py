"""Missions from files: `--plan FILE`, or `--plan NAME=FILE` for a vehicle of a scene with several vehicles."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from lapwing.cosim.scene import Scene


def overrides(plans: list[str], scene: Path, set_: list[str]) -> list[str]:
    """Return the overrides for vehicles with plans: they accept commands and do not follow the trajectory.

    Raises:
        ValueError: a plan without the name of a vehicle, or with an unknown name.
        SceneError: the scene is invalid.
    """
    from lapwing.services.common.plans.plan_file import OPERATED
    from lapwing.services.scene_resolver import load

    if not plans:
        return []
    base = load(scene, set_)
    if not base.vehicles:
        files(plans, base)
        return OPERATED
    names = [vehicle.lookup("vehicle.name") for vehicle in base.vehicles]
    return [f"vehicle.{names.index(name)}.{text}" for name in files(plans, base) for text in OPERATED]


def commands(
    plans: list[str], loaded: "Scene", report: Callable[[str], None] = lambda line: None
) -> Mapping[str, tuple[Any, ...]]:
    """Return the commands of each vehicle that flies a plan, by name. See `overrides` for errors.

    Args:
        plans: values of --plan.
        loaded: the scene.
        report: called with a line for each kind of items that are skipped, or flown in another way.
    """
    from lapwing.services.common.plans.plan_file import read, site_of

    scenes = {scene.lookup("vehicle.name"): scene for scene in loaded.each_vehicle}
    result = {}
    for name, path in files(plans, loaded).items():
        plan = read(path, site_of(scenes[name]))
        for note in plan.notes:
            report(f"{path}: {note}")
        result[name] = plan.commands
    return result


def files(plans: list[str], loaded: "Scene") -> dict[str, Path]:
    """Return the plan of each vehicle that flies one, by name. See `overrides` for errors."""
    if not loaded.vehicles:
        if len(plans) > 1:
            raise ValueError(f"--plan {plans[1]}: expected one plan, the scene has one vehicle")
        return {loaded.lookup("vehicle.name"): Path(path) for path in plans}
    names = [vehicle.lookup("vehicle.name") for vehicle in loaded.vehicles]
    result: dict[str, Path] = {}
    for text in plans:
        name, equals, path = text.partition("=")
        if not equals or name not in names or name in result:
            expected = f"NAME=FILE, a plan for each of {', '.join(names)} that flies one"
            fault = "the scene has several vehicles"
            if equals:
                fault = f"{name} has a plan already" if name in result else f"the scene has no vehicle {name}"
            raise ValueError(f"--plan {text}: {fault}; expected {expected}")
        result[name] = Path(path)
    return result
