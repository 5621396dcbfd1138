"""Observer of a run in progress."""

from typing import NamedTuple, Protocol

from lapwing.runs.compile_notice import Compilation


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
