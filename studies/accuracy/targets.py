"""From the name on the command line to a problem."""

import difflib
from collections.abc import Iterable
from pathlib import Path

from services.scene import Scene, load
from studies.accuracy.problem import Problem
from studies.accuracy.systems import problems


def find(target: str) -> Problem:
    """The problem of a name.

    Raises:
        ValueError: there is none; the text lists the choices.
    """
    known = problems()
    if target in known:
        return known[target]
    near = difflib.get_close_matches(target, known, n=1)
    hint = f"did you mean {near[0]}? " if near else ""
    raise ValueError(f"unknown target {target}: {hint}expected one of {', '.join(known)}, or a scene's .toml file")


def scene_of(target: str, overrides: Iterable[str]) -> Scene | None:
    """The scene that a target names, None where it names a problem.

    Raises:
        ValueError: no sound scene, or overrides without one.
    """
    if target.endswith(".toml"):
        return load(Path(target), overrides)
    if overrides := list(overrides):
        raise ValueError(f"--set {overrides[0]}: {target} is no scene, and has no keys to override")
    return None
