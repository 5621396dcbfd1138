"""Errors of a scene with a short traceback: it ends at the caller's line."""

from collections.abc import Callable
from functools import wraps
from typing import ParamSpec, TypeVar

from lapwing.cosim.scene import SceneError

P = ParamSpec("P")
T = TypeVar("T")


def short_errors(function: Callable[P, T]) -> Callable[P, T]:
    """Return the function; the traceback of a `SceneError` that it raises has no lines inside of it."""

    @wraps(function)
    def call(*args: P.args, **kwargs: P.kwargs) -> T:
        try:
            return function(*args, **kwargs)
        except SceneError as error:
            raise error.with_traceback(None) from error.__cause__

    return call
