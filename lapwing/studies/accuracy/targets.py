"""From the name on the command line to a problem."""

from collections.abc import Iterable
from pathlib import Path

from lapwing.cosim.scene import Scene
from lapwing.dynamics import discovery
from lapwing.services.common.run_schema import SHIPPED
from lapwing.services.scene_resolver import load
from lapwing.studies.accuracy.problem import Problem
from lapwing.studies.accuracy.systems import problems


def find(target: str) -> Problem:
    """The problem of a name.

    Raises:
        ValueError: there is none; the text lists the choices.
    """
    return discovery.choose(problems(), target, "problem")


def scene_of(target: str, overrides: Iterable[str]) -> Scene | None:
    """The scene that a target names, by its path or, where no problem has its name, by that; None for a problem.

    Raises:
        ValueError: no sound scene, or overrides without one.
    """
    shipped = target not in problems() and (SHIPPED / f"{target}.toml").is_file()
    if target.endswith(".toml") or shipped:
        return load(Path(target), overrides)
    if overrides := list(overrides):
        raise ValueError(f"--set {overrides[0]}: {target} is no scene, and has no keys to override")
    return None
