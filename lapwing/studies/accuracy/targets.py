"""Targets of `lapwing accuracy`: problems and scenes by name."""

from collections.abc import Iterable
from pathlib import Path

from lapwing.cosim.scene import KeyOrigin, Scene, SceneError
from lapwing.dynamics.config_error import did_you_mean
from lapwing.services.common.schemas.run_schema import SHIPPED
from lapwing.services.scene_resolver import load
from lapwing.studies.accuracy.problem import Problem
from lapwing.studies.accuracy.systems import problems


def find(target: str) -> Problem:
    """Return a problem by its name.

    Raises:
        ValueError: there is neither a problem nor a scene of this name; the message names the nearest of both.
    """
    if target in problems():
        return problems()[target]
    files = [path.stem for path in SHIPPED.glob("*.toml")] + [str(path) for path in Path().glob("*.toml")]
    hint = did_you_mean(target, [*problems(), *sorted(files)])
    expected = f"a scene (see lapwing scenes), its .toml file, or one of the problems {', '.join(problems())}"
    raise ValueError(f"unknown scene or problem '{target}'{hint or ';'} expected {expected}")


def scene_of(target: str, overrides: Iterable[str]) -> Scene | None:
    """Return the scene of a target, by its path or, if no problem has the name, by its name; None for a problem.

    Raises:
        ValueError: the scene is invalid, the target is unknown, or there are overrides without a scene.
    """
    shipped = target not in problems() and (SHIPPED / f"{target}.toml").is_file()
    if target.endswith(".toml") or shipped:
        return load(Path(target), overrides)
    find(target)
    for text in overrides:
        raise SceneError("", f"{target} is a problem; expected a scene", source=KeyOrigin(override=text))
    return None
