"""Interface between the adapter of a firmware and the block that steps it."""

from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from typing import Any, NamedTuple, Protocol

from lapwing.cosim.run_errors import LockStepError
from lapwing.services.common.firmware.setup import FirmwareSetup

Read = Callable[[str], Any]  # newest sample of a port
Waits = Callable[[str], None]  # called at least every 0.2 s with the reason of a wait; raises to end the run


class FirmwareError(LockStepError):
    """Error of a firmware that stalls or violates its protocol; the text has its name, the time and a remedy."""


class FirmwareOutput(NamedTuple):
    """Outputs and state of a firmware after an exchange."""

    outputs: tuple[float, ...]  # 0 to 1, in the firmware's order; fraction of the battery's voltage at a motor
    armed: bool
    landed: bool = False
    finished: bool = False  # the mission is over: the run may end
    mode: str = ""  # flight mode, for display
    text: str = ""  # reason of an active failsafe; "": none
    arming_blockers: tuple[str, ...] = ()
    attitude_reference: tuple[float, float, float] = (0.0, 0.0, 0.0)  # [rad] roll, pitch, yaw setpoints, if known


@dataclass
class LinkReport:
    """Counts of one link; the log's metadata and the summary show them."""

    firmware: str
    version: str = ""  # reported by the firmware
    steps: int = 0  # exchanges
    skew_max: float = 0.0  # [s] largest difference between the firmware's and the simulation time
    resent: int = 0  # frames sent again by either side
    late: int = 0  # replies after their due time
    missed: int = 0  # replies that did not arrive
    rejected: int = 0  # packets that were malformed, non-finite or from elsewhere
    reconnected: int = 0  # reconnections of the firmware
    waiting: float = 0.0  # [s] of wall time spent waiting for the firmware
    wall: float = 0.0  # [s] of wall time from the first exchange to the last
    cpu: float = 0.0  # [s] of CPU time of the firmware in flight, 0 if Lapwing has not started it
    own_cpu: float = 0.0  # [s] of CPU time of this process in the same time
    jitter: float = 0.0  # [s] standard deviation of the wall time between exchanges (real time only)
    reproducible: bool = True  # False: no lock step, so two runs differ
    notes: list[str] = field(default_factory=list)  # warnings for the user, each once

    @property
    def fields(self) -> dict[str, Any]:
        """All counts as plain data."""
        return asdict(self)

    def note(self, text: str) -> None:
        """Add a warning, each text once."""
        if text not in self.notes:
            self.notes.append(text)

    def __str__(self) -> str:
        """Return the counts in one line."""
        share = 100.0 * self.waiting / self.wall if self.wall > 0.0 else 0.0
        parts = [f"{self.steps} steps", f"skew {1e3 * self.skew_max:.3g} ms"]
        parts += [f"{name} {getattr(self, name)}" for name in ("resent", "late", "missed", "rejected", "reconnected")]
        parts.append(f"waiting {share:.0f} %")
        if self.cpu > 0.0:
            parts.append(f"CPU {self.own_cpu:.3g} s of Lapwing and {self.cpu:.3g} s of the firmware")
        if not self.reproducible:
            parts.append(f"jitter {1e3 * self.jitter:.2f} ms, not reproducible")
        return f"{' '.join(filter(None, (self.firmware, self.version)))}: {', '.join(parts)}"


class Link(Protocol):
    """Connection to one running firmware. See the package for the order of the calls."""

    report: LinkReport

    def __init__(self, setup: FirmwareSetup) -> None:
        """Store the configuration; open nothing."""

    def open(self, waits: Waits) -> None:
        """Start the firmware or wait for it, and connect."""

    @property
    def pid(self) -> int | None:
        """Process id of the firmware, None if this link has not started it."""

    def cpu(self) -> float:
        """Return the CPU time [s] that the firmware has used, 0 if this link has not started it."""

    def close(self) -> None:
        """Close the connection, and end the program if this link has started it."""


class FirmwareLink(Link, Protocol):
    """Link that Python code steps."""

    def step(self, tick: int, read: Read, waits: Waits) -> FirmwareOutput:
        """Send the samples at `tick`, and return the firmware's outputs."""


class ExchangeLink(Link, Protocol):
    """Link with which compiled code exchanges samples and outputs (`exchange`)."""

    outputs: int  # number of outputs

    def exchange(self, shared: Any, ring: Callable[[str], Any]) -> Any:
        """Return the parameters of the compiled exchange.

        Args:
            shared: `exchange.Shared` memory.
            ring: returns the `InputRing` of a port.
        """

    def handle_call(self, tick: int, reason: int, number: int, read: Read, waits: Waits) -> FirmwareOutput | None:
        """Handle a call from compiled code at `tick`: wait for outputs, send again, or poll the MAVLink link.

        Args:
            tick: tick of the exchange.
            reason: WAIT, SEND, POLL or INVALID of `exchange`.
            number: for WAIT, size [bytes] of the datagram that compiled code received.
            read: returns the newest sample of a port.
            waits: see `Waits`.

        Returns:
            The state of the vehicle without outputs after a poll, otherwise None.
        """
