"""The user is told when something compiles, and only then."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from dynamics.kernel import on_compile

NOTICE = "compiling kernels (first run only) ..."


@contextmanager
def told(say: Callable[[str], None]) -> Iterator[None]:
    """Say so once, as soon as a kernel is compiled within the context."""
    waiting = True

    def listener(_: str) -> None:
        nonlocal waiting
        if waiting:
            waiting = False
            say(NOTICE)

    on_compile(listener)
    try:
        yield
    finally:
        waiting = False
