"""Integration from Python with checked arguments: fixed steps of a named method, or adaptive steps to a tolerance."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from lapwing.dynamics.integrators import _adaptive
from lapwing.dynamics.integrators._fixed_step import record
from lapwing.dynamics.lie.quaternion import Quaternion
from lapwing.dynamics.lie.so3 import Rotation, determinant
from lapwing.kernels.state_tree import MANIFOLDS, flatten, normalise, unflatten

UNIT_DEFECT = 1e-9  # largest distance of an initial attitude or direction from its manifold
SMALLEST_TOLERANCE = 1e-14


def named_numbers(x: Any, name: str = "") -> Iterator[tuple[str, float]]:
    """Yield (path, value) of every number of a state, such as ("omega_body[2]", 0.1)."""
    if isinstance(x, tuple):
        fields = getattr(x, "_fields", None)
        for i, part in enumerate(x):
            step = f"[{i}]" if fields is None else f".{fields[i]}"
            yield from named_numbers(part, f"{name}{step}".lstrip("."))
    elif x is not None:
        yield name, x


def _leaves(x: Any, name: str = "") -> Iterator[tuple[str, Any]]:
    """Yield (path, leaf) of every manifold leaf."""
    if type(x) in MANIFOLDS:
        yield name or type(x).__name__, x
    elif isinstance(x, tuple):
        fields = getattr(x, "_fields", range(len(x)))
        for key, part in zip(fields, x, strict=True):
            yield from _leaves(part, f"{name}.{key}".lstrip("."))


def _system(p: Any) -> str:
    return type(p).__name__.removesuffix("Parameters")


def not_finite(x: Any) -> str:
    """Return name and value of the first number of a state that is NaN or infinite."""
    return next((f"{name} = {value}" for name, value in named_numbers(x) if not np.isfinite(value)), "its rate")


def check_start(p: Any, x0: Any) -> None:
    """Raise ValueError if a number of the parameters or the initial state is not finite, or a leaf is off its manifold.

    A method `check(x0)` of the parameter class is also called.
    """
    for what, tree in (("parameter", p), ("initial", x0)):
        for name, value in named_numbers(tree):
            if not np.isfinite(value):
                raise ValueError(f"{_system(p)}: {what} {name} = {value}: must be finite")
    for name, result in _leaves(x0):
        if type(result) is Rotation and determinant(result) < 0.0:
            raise ValueError(f"{_system(p)}: initial {name} is not a rotation: determinant {determinant(result):.3g}")
        no = "not a rotation, " if type(result) in (Quaternion, Rotation) else ""
        if not np.isfinite(flatten(normalise(result))).all():
            raise ValueError(f"{_system(p)}: initial {name} is {no or 'not a direction, '}all zero")
        defect = max(abs(a - b) for a, b in zip(flatten(result), flatten(normalise(result)), strict=True))
        if not defect <= UNIT_DEFECT:
            raise ValueError(f"{_system(p)}: initial {name} is {no}off its manifold by {defect:.3g}: normalise it")
    if hasattr(p, "check"):
        p.check(x0)


def simulate(method: Any, p: Any, x0: Any, h: float, steps: int, every: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """Integrate in fixed steps h from time 0. Return (times, states), one row (see `unflatten`) per `every` steps.

    `method` is a method's module, from `get`. Raise ValueError for a step that is not positive, an invalid initial
    state, or a state that becomes non-finite; the message names time, system and value.
    """
    if not (h > 0.0 and np.isfinite(h)):
        raise ValueError(f"{_system(p)}: step {h:g}: must be positive and finite")
    check_start(p, x0)
    out = np.empty((steps // every + 1, len(flatten(x0))))
    rows = record(method.Method(), p, 0.0, x0, h, every, out)
    times = h * every * np.arange(len(out))
    if rows < len(out):
        bad = not_finite(unflatten(x0, tuple(map(float, out[rows]))))
        raise ValueError(
            f"{_system(p)}: not finite by t = {times[rows]:g} s with step {h:g}: {bad}; take a smaller step"
        )
    return times, out


def solve(p: Any, x0: Any, times: np.ndarray, tolerance: float) -> tuple[np.ndarray, dict[str, int]]:
    """Integrate adaptively. Return (states at `times`, {"steps", "rejected"}), rows as in `simulate`; x0 at times[0].

    `tolerance` is the error per step, relative to 1 + |x| for floats, absolute on manifolds. Raise ValueError as
    `simulate`, and if the tolerance cannot be met; the message names time, system and state.
    """
    times = np.ascontiguousarray(times, dtype=float)
    if len(times) < 2 or not (np.diff(times) > 0.0).all():
        raise ValueError(f"{_system(p)}: output times must be two or more and increase")
    if not tolerance >= SMALLEST_TOLERANCE:
        raise ValueError(f"{_system(p)}: tolerance {tolerance:g} cannot be met: at least {SMALLEST_TOLERANCE:g}")
    check_start(p, x0)
    out = np.empty((len(times), len(flatten(x0))))
    status, t, x, steps, rejected = _adaptive.integrate_adaptive(p, x0, times, tolerance, out)
    if status == _adaptive.STEP_TOO_SMALL:
        where = ", ".join(f"{name} = {value:.6g}" for name, value in named_numbers(x))
        raise ValueError(f"{_system(p)}: tolerance {tolerance:g} cannot be met at t = {t:.9g} s, state {where}")
    if status == _adaptive.NOT_FINITE:
        raise ValueError(f"{_system(p)}: not finite at t = {t:.9g} s: {not_finite(x)}")
    return out, {"steps": steps, "rejected": rejected}
