"""Targets of `lapwing accuracy`: problems and scenes by name."""

from collections.abc import Iterable
from pathlib import Path

from lapwing.cosim.scene import Scene
from lapwing.dynamics import discovery
from lapwing.services.common.schemas.run_schema import SHIPPED
from lapwing.services.scene_resolver import load
from lapwing.studies.accuracy.problem import Problem
from lapwing.studies.accuracy.systems import problems


def find(target: str) -> Problem:
    """Return a problem by its name.

    Raises:
        ValueError: the problem is unknown; the message lists the choices.
    """
    return discovery.choose(problems(), target, "problem")


def scene_of(target: str, overrides: Iterable[str]) -> Scene | None:
    """Return the scene of a target, by its path or, if no problem has the name, by its name; None for a problem.

    Raises:
        ValueError: the scene is invalid, or there are overrides without a scene.
    """
    shipped = target not in problems() and (SHIPPED / f"{target}.toml").is_file()
    if target.endswith(".toml") or shipped:
        return load(Path(target), overrides)
    if overrides := list(overrides):
        raise ValueError(f"override {overrides[0]}: {target} is not a scene; use overrides with a scene")
    return None
