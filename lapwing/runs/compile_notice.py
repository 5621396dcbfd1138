"""The user is told when something compiles, and only then: what, and about how long, which is the longest so far."""

import contextlib
import json
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

from lapwing.cosim.config.run_config import RunConfig
from lapwing.kernels import cache_folder, on_compile

EACH = 5.0  # [s] a service takes to compile, on an idle core of 2024, where nothing is known of this machine
FILE = "compile_seconds.json"
ONE = "one process"


class Compilation(NamedTuple):
    """Of the kernels of a run.

    Attributes:
        scene: its name.
        services: that are compiled, as far as they are not kept.
        seconds: about how long that takes.
    """

    scene: str
    services: tuple[str, ...]
    seconds: float

    @property
    def notice(self) -> str:
        """What is said where there is no bar."""
        about = f"about {self.seconds:.0f} s (kept for later runs)"
        return f"{self.scene}: compiling kernels of {', '.join(self.services)}, {about} ..."


class Stopwatch:
    """How long the kernels of a run compile: a guess before, what it was after.

    It is told of the first compilation with `began`, and of the end with `ended`; a run that finds all kernels on the
    disk tells it of neither, and nothing is said.
    """

    def __init__(self, mode: str, setup: RunConfig, say: Callable[[Compilation], None]):
        """`say` is called once, when something compiles."""
        self._key, self._say, self._started = _key(mode, setup), say, 0.0
        self._guess = guessed(setup, mode)

    def began(self) -> None:
        """Something compiles; said once."""
        if not self._started:
            self._started = time.monotonic()
            self._say(self._guess)

    def ended(self) -> None:
        """Everything is compiled."""
        if self._started:
            known, taken = _known(), round(time.monotonic() - self._started, 1)
            _keep({**known, self._key: max(taken, known.get(self._key, 0.0))})
            self._started = 0.0


@contextmanager
def notify_on_compile(setup: RunConfig, say: Callable[[Compilation], None], alone: bool = True) -> Iterator[None]:
    """Say so once, as soon as a kernel is compiled within the context for a run in this process.

    Args:
        setup: of the run.
        say: is told.
        alone: whether the context does nothing else, so that its time is the next guess.
    """
    watch, waiting = Stopwatch(ONE, setup, say), True

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


def guessed(setup: RunConfig, mode: str = ONE) -> Compilation:
    """What a run compiles where none of its kernels is kept."""
    seconds = _known().get(_key(mode, setup), EACH * len(setup.services))
    return Compilation(setup.scene, tuple(setup.services), seconds)


def _key(mode: str, setup: RunConfig) -> str:
    return f"{mode}: {setup.scene}: {', '.join(setup.services)}"


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
