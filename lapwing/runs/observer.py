"""What a run tells while it goes on."""

from typing import NamedTuple, Protocol

from lapwing.runs.compile_notice import Compilation


class Elapsed(NamedTuple):
    """How long a run took."""

    simulated: float  # [s]
    wall: float  # [s]


class Observer(Protocol):
    """Who is told how far a run is: a display, or nobody."""

    def begin(self) -> None:
        """The first tick is being flown."""
        ...

    def show(self, time_ns: int, pose: bytes | None, status: bytes | None) -> None:
        """The run is at `time_ns`; the newest payloads of the pose and status topics."""
        ...

    def compiling(self, what: Compilation) -> None:
        """Kernels are being compiled, which ends with `begin`."""
        ...

    def say(self, line: str) -> None:
        """A line for the user."""
        ...


class Silent:
    """Nobody."""

    def begin(self) -> None:
        """Say nothing."""

    def show(self, time_ns: int, pose: bytes | None, status: bytes | None) -> None:
        """Say nothing."""

    def compiling(self, what: Compilation) -> None:
        """Say nothing."""

    def say(self, line: str) -> None:
        """Say nothing."""
