"""From the name on the command line to a problem."""

import difflib

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
