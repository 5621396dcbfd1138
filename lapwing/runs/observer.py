"""Observer of a run in progress, and its notice that kernels compile."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import NamedTuple, Protocol, Self

from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.diagram.compiled_loop import set_compiling
from lapwing.kernels import on_compile


class Compilation(NamedTuple):
    """Compile-time notice for the kernels of a run.

    Attributes:
        scene: name of the scene.
        services: names of the services; some of their kernels may be in the cache.
    """

    scene: str
    services: tuple[str, ...]

    @classmethod
    def of(cls, config: RunConfig) -> Self:
        """Return the notice for a run."""
        return cls(config.scene, tuple(config.services))

    @property
    def notice(self) -> str:
        """Text of the notice for output without a progress bar."""
        return f"{self.scene}: compiling kernels of {', '.join(self.services)} (cached for later runs) ..."


@contextmanager
def notify_on_compile(config: RunConfig, show: Callable[[Compilation], None]) -> Iterator[None]:
    """Show a notice once when a kernel is compiled within the context, for a run in this process.

    Args:
        config: run configuration.
        show: shows the notice.
    """
    active = True

    def listener(_: str) -> None:
        nonlocal active
        if active:
            active = False
            set_compiling(", ".join(config.services))
            show(Compilation.of(config))

    on_compile(listener)
    try:
        yield
    finally:
        active = False
        set_compiling("")


class Elapsed(NamedTuple):
    """Simulated and wall time of a run."""

    simulated: float  # [s]
    wall: float  # [s]


class Observer(Protocol):
    """Interface of a progress display."""

    def begin(self) -> None:
        """Start the display: the first tick has been stepped."""
        return

    def show(self, time_ns: int, pose: bytes | None, status: bytes | None) -> None:
        """Show the progress at `time_ns`, with the newest payloads of the pose and status topics."""
        return

    def compiling(self, compilation: Compilation) -> None:
        """Show that kernels are being compiled, until `begin`."""
        return

    def say(self, line: str) -> None:
        """Show a line to the user."""
        return


class Silent(Observer):
    """Observer that shows nothing."""
