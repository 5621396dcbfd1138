"""Link to a firmware: its program, its instance, time-outs, and the report of the link."""

import socket
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple, NoReturn

from lapwing.cosim.processes.patience import Patience
from lapwing.cosim.processes.shared_core import process_tree
from lapwing.services.common.firmware.firmware_config import FirmwareConfig
from lapwing.services.common.firmware.program import (
    QUOTE,
    FirmwareError,
    OwnPort,
    PortInUseError,
    Program,
    bound_socket,
    owner_of_port,
)
from lapwing.services.common.firmware.repeatable import ELSEWHERE, OFF, SHELL, Repeatable, Turns, library

LOADED = 5.0  # [s] from the start to the library's report
STARTS = 5  # most starts of a program whose ports are in use

Read = Callable[[str], Any]  # newest sample of a port
Waits = Callable[[str], None]  # called at least every 0.2 s with the reason of a wait; raises to end the run


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
    follows: bool = False  # the scene's trajectory commands the vehicle, not a mission, a failsafe or a landing


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
    unrepeatable: str = ""  # why two flights differ, "" if they do not
    notes: list[str] = field(default_factory=list)  # warnings for the user, each once

    def note(self, text: str) -> None:
        """Add a warning, each text once."""
        if text not in self.notes:
            self.notes.append(text)

    def reject(self, text: str) -> None:
        """Count a rejected packet, and add its warning."""
        self.rejected += 1
        self.note(text)

    def __str__(self) -> str:
        """Return the counts in one line."""
        share = 100.0 * self.waiting / self.wall if self.wall > 0.0 else 0.0
        parts = [f"{self.steps} steps", f"skew {1e3 * self.skew_max:.3g} ms"]
        parts += [f"{name} {getattr(self, name)}" for name in ("resent", "late", "missed", "rejected", "reconnected")]
        parts.append(f"waiting {share:.0f} %")
        if self.cpu > 0.0:
            parts.append(f"CPU {self.own_cpu:.3g} s of Lapwing and {self.cpu:.3g} s of the firmware")
        if self.unrepeatable:
            parts.append(f"not repeatable: {self.unrepeatable}")
        return f"{' '.join(filter(None, (self.firmware, self.version)))}: {', '.join(parts)}"


class ProgramLink:
    """Connection to one running firmware, whose program it starts unless the user does.

    Attributes:
        report: counts of the link.
        log: log of the run, beside which output and logs of the program are kept; None if the run has none.
    """

    INSTANCES = 1  # instances with separate ports
    OWN_PORTS: tuple[OwnPort, ...] = ()  # which the program opens
    OWN_LOGS = ""  # pattern of the program's logs in its working directory
    ADVICE = "stop the other program that uses it, or set autopilot.instance"

    log: Path | None = None
    _claim: Callable[[], None]  # open the ports of Lapwing for the instance; PortInUseError if one is in use
    _begin: Callable[[], None]  # start the program or wait for it, and connect
    _waits: Waits
    program: Program | None = None  # None if Lapwing has not started it
    _time = 0.0  # [s] simulation time
    _flying = False
    _reason = ELSEWHERE  # why two flights differ, of a program without the library
    in_turns = False  # the firmware answers each message once all of its threads wait
    _known_peer: tuple[tuple[int, int] | None, int | None] = (None, None)  # end of the link, and its process

    def __init__(self, config: FirmwareConfig) -> None:
        """Store the configuration; open nothing."""
        self._config, self.report = config, LinkReport(config.firmware)

    def open(self, waits: Waits) -> None:
        """Start the firmware or wait for it, and connect.

        A program that Lapwing starts gets the first instance whose ports are free: runs side by side, as in a campaign,
        get different ones.

        Raises:
            FirmwareError: it does not start, or no instance is free.
        """
        config, starts, self._waits = self._config, 0, waits
        first = config.instance or 0
        for instance in range(first, max(self.INSTANCES, first + 1)):
            self._config = config._replace(instance=instance)
            try:
                self._claim()
                self._check_own_ports()
                self._begin()
            except FirmwareError as error:
                quote = self.program.quote() if self.program and QUOTE not in str(error) else ""
                starts += self.program is not None
                self.close()
                last = not config.chooses or instance + 1 >= self.INSTANCES or starts >= STARTS
                if last or not isinstance(error, PortInUseError):
                    raise type(error)(f"{error}{quote}") from None
                continue
            self._flying = True
            return

    def close(self) -> None:
        """End the program, then free the ports: another run may use the instance at once."""
        self._reason = self.unrepeatable
        if self.program:
            self.program.close()
        self.program = None

    def _check_own_ports(self) -> None:
        """Raise PortInUseError if a port that the program will open is in use."""
        if self._config.command:
            for port in self.OWN_PORTS:
                self._bound(port.kind, port.default + port.stride * (self._config.instance or 0)).close()

    def _bound(self, kind: int, port: int) -> socket.socket:
        return bound_socket(self._config.firmware, kind, self._config.host, port, self.ADVICE)

    def _start(
        self,
        arguments: Sequence[str] = (),
        files: Any = None,
        variables: dict[str, str] | None = None,
        turns: Turns | None = None,
    ) -> None:
        """Start the program; those of the scene take precedence over environment `variables`. See `Program`."""
        config = self._config._replace(environment={**(variables or {}), **self._config.environment})
        prepared = self._prepare(turns) if turns else None
        self.program = Program(config, arguments, files, self.log, self.OWN_LOGS, prepared)

    def _prepare(self, turns: Turns) -> Repeatable | None:
        """Return the library that makes the program repeatable, None if there is none, for a reason that is stored."""
        try:
            path = library() if self._config.repeatable and not self._config.shell else None
        except OSError as error:
            self._reason = str(error)
            return None
        self._reason = "" if path else SHELL if self._config.shell else OFF
        return Repeatable(path, turns, self._config.schedule) if path else None

    def _take_turns(self, event: str) -> None:
        """Wait until the library reports an event; without it, the firmware does not run in turns."""
        repeatable = self.program.repeatable if self.program else None
        loaded, started = self._patience(LOADED), self._patience(self._config.start_timeout)
        self.in_turns = False
        while repeatable and not self.in_turns:
            if (started if repeatable.attached and event == "ready" else loaded).over:
                return
            self._waits(self._config.firmware)
            repeatable.read()
            self._check_program()
            self.in_turns = getattr(repeatable, event)
            time.sleep(0.0 if self.in_turns else 0.01)

    @property
    def unrepeatable(self) -> str:
        """Reason why two flights differ, "" if they do not."""
        repeatable = self.program.repeatable if self.program else None
        return repeatable.problem if repeatable else self._reason

    @property
    def output(self) -> str:
        """Name of the file beside the log of the run that has the program's output, "" without one."""
        return self.program.output.name if self.program and self.log else ""

    def cpu(self) -> float:
        """Return the CPU time [s] of the program, 0 if Lapwing has not started it."""
        return self.program.cpu() if self.program else 0.0

    def _peer(self) -> tuple[int, int] | None:
        """Return kind and port of the firmware's end of the link, None without a connection."""
        return None

    def _patience(self, timeout: float) -> Patience:
        """Return a time-out that does not pass while the firmware is stopped, also one that the user has started."""
        if self.program:
            return Patience(timeout, *process_tree(self.program.pid), pauses=True)
        peer = self._peer()
        if peer != self._known_peer[0]:
            self._known_peer = peer, owner_of_port(*peer) if peer else None
        return Patience(timeout, self._known_peer[1], pauses=True)

    def _attempts(self, reason: str, timeout: float) -> Iterator[None]:
        """Yield before each attempt, which may take 0.2 s, and once more after `timeout` [s].

        Raises:
            FirmwareError: the program has ended.
        """
        patience, over = None, False
        while not over:
            over = patience is not None and patience.over
            self._waits(reason)
            self._check_program()
            yield
            patience = patience or self._patience(timeout)

    @property
    def _when(self) -> str:
        return f" at t = {self._time:.3f} s" if self._flying else " at its start"

    def _check_program(self) -> None:
        if self.program:
            self.program.check(self._when, not self._flying)
            if self.program.repeatable and self.program.repeatable.stuck:
                self._fail(self.program.repeatable.stuck, f"set {OFF}")

    def _time_out(self, problem: str, advice: str) -> NoReturn:
        """Raise FirmwareError, which also names the key of the time-out."""
        self._fail(problem, f"{advice}, or raise autopilot.{'step' if self._flying else 'start'}_timeout")

    def _fail(self, problem: str, advice: str) -> NoReturn:
        quote = self.program.quote() if self.program else ""
        raise FirmwareError(f"{self._config.firmware}: {problem}{self._when}; {advice}{quote}")
