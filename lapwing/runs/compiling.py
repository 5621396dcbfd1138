"""The user is told when something compiles, and only then, with a guess of how long: as long as the last time."""

import contextlib
import json
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from cosim.setup import Setup
from dynamics.kernel import cache_folder, on_compile

EACH = 12.0  # [s] a service takes to compile, on an idle core of 2020, where nothing is known of this machine
FILE = "compile_seconds.json"
ONE = "one process"


def notice(guess: float) -> str:
    """What is said where there is no bar: about how long it takes [s]."""
    return f"compiling kernels, about {guess:.0f} s (they are kept for later runs) ..."


class Stopwatch:
    """How long the kernels of a run compile: a guess before, what it was after.

    It is told of the first compilation with `began`, and of the end with `ended`; a run that finds all kernels on the
    disk tells it of neither, and nothing is said.
    """

    def __init__(self, mode: str, services: Iterable[str], say: Callable[[float], None]):
        """`say` is called once with the guess [s], when something compiles."""
        names = list(services)
        self._key, self._say, self._started = _key(mode, names), say, 0.0
        self._guess = _guess(mode, names)

    def began(self) -> None:
        """Something compiles; said once."""
        if not self._started:
            self._started = time.monotonic()
            self._say(self._guess)

    def ended(self) -> None:
        """Everything is compiled."""
        if self._started:
            _keep({**_known(), self._key: round(time.monotonic() - self._started, 1)})
            self._started = 0.0


@contextmanager
def told(setup: Setup, say: Callable[[float], None], alone: bool = True) -> Iterator[None]:
    """Say so once, with a guess [s], as soon as a kernel is compiled within the context for a run in this process.

    Args:
        setup: of the run.
        say: is told.
        alone: whether the context does nothing else, so that its time is the next guess.
    """
    watch, waiting = Stopwatch(ONE, setup.services, say), True

    def listener(_: str) -> None:
        if waiting:
            watch.began()

    on_compile(listener)
    try:
        yield
        if alone:
            watch.ended()
    finally:
        waiting = False


def guessed(setup: Setup) -> float:
    """How long [s] the kernels of a run in one process compile, where none is kept."""
    return _guess(ONE, list(setup.services))


def _key(mode: str, names: list[str]) -> str:
    return f"{mode}: {', '.join(names)}"


def _guess(mode: str, names: list[str]) -> float:
    return _known().get(_key(mode, names), EACH * len(names))


def _file() -> Path | None:
    folder = cache_folder()
    return folder / FILE if folder else None


def _known() -> dict[str, float]:
    """Seconds by kind of run; what cannot be read is not known."""
    path = _file()
    with contextlib.suppress(OSError, ValueError, TypeError):
        if path is not None and isinstance(found := json.loads(path.read_text(encoding="utf-8")), dict):
            return {str(key): float(value) for key, value in found.items()}
    return {}


def _keep(known: dict[str, float]) -> None:
    path = _file()
    with contextlib.suppress(OSError):
        if path is not None:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(json.dumps(known, indent=1) + "\n", encoding="utf-8")
