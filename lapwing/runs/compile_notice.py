"""Compile-time notice: tells the user that kernels compile, and the time that this takes on this machine.

The estimate is the longest time so far, or EACH for a service, times `slowness`: the present time of a fixed piece of
Python, which grows with the load of the machine as compiling does.
"""

import contextlib
import json
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

from lapwing.cosim.config.run_config import RunConfig
from lapwing.kernels import cache_folder, on_compile

EACH = 7.0  # [s] default for one service at a slowness of 1; measured with scene hover
PROBE = 250_000  # iterations of the loop that measures the slowness
PROBE_SECONDS = 0.033  # [s] of that loop on the idle core of EACH
FILE = "compile_effort.json"  # seconds at a slowness of 1, by kind of run
ONE = "one process"


class Compilation(NamedTuple):
    """Compile-time notice for the kernels of a run.

    Attributes:
        scene: name of the scene.
        services: names of the services, of which some kernels may be in the cache.
        seconds: estimated time [s].
    """

    scene: str
    services: tuple[str, ...]
    seconds: float

    @property
    def notice(self) -> str:
        """Text of the notice for output without a progress bar."""
        about = f"about {self.seconds:.0f} s (cached for later runs)"
        return f"{self.scene}: compiling kernels of {', '.join(self.services)}, {about} ..."


class Stopwatch:
    """Stopwatch of the compilation of a run: an estimate before, the measured time after.

    Call `start` at the first compilation and `stop` at the end. If all kernels are in the cache, neither is called and
    no notice is printed.
    """

    def __init__(self, mode: str, setup: RunConfig, show: Callable[[Compilation], None]):
        """Prepare a notice; `show` is called once, when the first kernel compiles."""
        self._key, self._show, self._started = _key(mode, setup), show, 0.0
        self._setup, self._mode, self._slowness = setup, mode, 1.0

    def start(self) -> None:
        """Note the first compilation; later calls have no effect."""
        if not self._started:
            self._started, self._slowness = time.monotonic(), slowness()
            self._show(_estimate(self._setup, self._mode, self._slowness))

    def stop(self) -> None:
        """Note that everything is compiled, and store the measured time."""
        if self._started:
            mean = 0.5 * (self._slowness + slowness())
            known, seconds = _stored_seconds(), round((time.monotonic() - self._started) / mean, 1)
            _store({**known, self._key: max(seconds, known.get(self._key, 0.0))})
            self._started = 0.0


@contextmanager
def notify_on_compile(setup: RunConfig, show: Callable[[Compilation], None], alone: bool = True) -> Iterator[Stopwatch]:
    """Show a notice once when a kernel is compiled within the context, for a run in this process.

    Args:
        setup: run configuration.
        show: shows the notice.
        alone: True if the context does nothing else, so that its duration is the next estimate; otherwise the caller
            calls `stop` of the yielded stopwatch.
    """
    watch, active = Stopwatch(ONE, setup, show), True

    def listener(_: str) -> None:
        if active:
            watch.start()

    on_compile(listener)
    try:
        yield watch
        if alone:
            watch.stop()
    finally:
        active = False


def estimate(setup: RunConfig, mode: str = ONE) -> Compilation:
    """Return the notice for a run with an empty cache, at the present load of the machine."""
    return _estimate(setup, mode, slowness())


def slowness() -> float:
    """Return the present time of a fixed loop in Python over its time on an idle core of EACH."""
    started, x = time.perf_counter(), 0
    for i in range(PROBE):
        x = (x * 31 + i) % 1_000_003
    return (time.perf_counter() - started) / PROBE_SECONDS


def _estimate(setup: RunConfig, mode: str, slow: float) -> Compilation:
    seconds = _stored_seconds().get(_key(mode, setup), EACH * len(setup.services))
    return Compilation(setup.scene, tuple(setup.services), slow * seconds)


def _key(mode: str, setup: RunConfig) -> str:
    return f"{mode}: {setup.scene}: {', '.join(setup.services)}"


def _file() -> Path | None:
    folder = cache_folder()
    return folder / FILE if folder else None


def _stored_seconds() -> dict[str, float]:
    """Return seconds by kind of run; entries that cannot be read are omitted."""
    path = _file()
    with contextlib.suppress(OSError, ValueError, TypeError):
        if path is not None and isinstance(result := json.loads(path.read_text(encoding="utf-8")), dict):
            return {str(key): float(value) for key, value in result.items()}
    return {}


def _store(known: dict[str, float]) -> None:
    path = _file()
    with contextlib.suppress(OSError):
        if path is not None:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(json.dumps(known, indent=1) + "\n", encoding="utf-8")
