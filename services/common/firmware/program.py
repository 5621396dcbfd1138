"""Program of a firmware, started in its own process group and terminated with the group."""

import ctypes
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any, NoReturn

from lapwing.cosim.processes.patience import Patience
from lapwing.cosim.processes.shared_core import process_tree, total_cpu_time
from lapwing.services.common.firmware.link import FirmwareError
from lapwing.services.common.firmware.setup import FirmwareSetup

GRACE = 2.0  # [s] from SIGTERM to SIGKILL
TAIL = 3  # last lines of the output in a message
_DEATH_SIGNAL = 1  # PR_SET_PDEATHSIG


class Program:
    """The firmware's program, if Lapwing starts it."""

    def __init__(self, setup: FirmwareSetup, arguments: Sequence[str] = (), files: dict[str, str] | None = None):
        """Start the program.

        Args:
            setup: command, working directory and environment.
            arguments: further arguments.
            files: content of files to write into the working directory, by name.

        Raises:
            FirmwareError: the program or the directory does not exist.
        """
        self._firmware = setup.firmware
        self._temporary = None if setup.directory else tempfile.TemporaryDirectory(prefix=f"lapwing_{setup.firmware}_")
        self.directory = Path(setup.directory or self._temporary.name)  # type: ignore[union-attr]
        self._output = tempfile.TemporaryFile()  # noqa: SIM115 (closed by `close`)
        try:
            for name, content in (files or {}).items():
                (self.directory / name).write_text(content)
            self._start: partial[subprocess.Popen[Any]] = partial(
                subprocess.Popen,
                [*setup.command, *arguments],
                cwd=self.directory,
                env={**os.environ, **setup.environment},
                stdin=subprocess.DEVNULL,
                stdout=self._output,
                stderr=subprocess.STDOUT,
                start_new_session=True,
                preexec_fn=_end_with_parent if sys.platform == "linux" else None,
            )
            self._process = self._start()
        except OSError as error:
            self._discard()
            where = error.filename or setup.command[0]
            message = f"{setup.firmware}: cannot start {where} ({error.strerror})"
            raise FirmwareError(f"{message}; check autopilot.command and autopilot.directory") from None

    @property
    def pid(self) -> int:
        """Process id, also of its process group."""
        return self._process.pid

    @property
    def running(self) -> bool:
        """True until the program ends."""
        return self._process.poll() is None

    def restart(self) -> None:
        """Start the program again, after it has ended."""
        self._process.wait()
        self._process = self._start()

    def check(self, when: str = "") -> None:
        """Raise FirmwareError if the program has ended."""
        code = self._process.poll()
        if code is not None:
            reason = f"signal {-code}" if code < 0 else f"exit code {code}"
            last = " | ".join(self.text().splitlines()[-TAIL:])
            raise FirmwareError(f"{self._firmware}: the program ended ({reason}){when}: {last or 'no output'}")

    def text(self) -> str:
        """Return the output so far."""
        self._output.seek(0)
        return self._output.read().decode(errors="replace").strip()

    def cpu(self) -> float:
        """Return the CPU time [s] that it and its descendants use, or 0 if the system does not report it."""
        return sum(map(total_cpu_time, process_tree(self.pid)))

    def close(self) -> None:
        """End the program and its children, and remove its temporary folder."""
        self.stop()
        self._discard()

    def stop(self) -> None:
        """End the program and its children, by request, then by force."""
        self._signal(signal.SIGTERM)
        deadline = time.monotonic() + GRACE
        while self._process.poll() is None and time.monotonic() < deadline:
            time.sleep(0.01)
        self._signal(signal.SIGKILL)
        self._process.wait()

    def _signal(self, number: int) -> None:
        with suppress(ProcessLookupError, PermissionError):
            os.killpg(self.pid, number)

    def _discard(self) -> None:
        self._output.close()
        if self._temporary:
            self._temporary.cleanup()


class ProgramLink:
    """Base class of links that start the firmware's program, unless the user starts it."""

    _setup: FirmwareSetup
    _program: Program | None = None
    _time = 0.0  # [s] simulation time

    @property
    def pid(self) -> int | None:
        """Process id of the program, None if Lapwing has not started it."""
        return self._program.pid if self._program else None

    def cpu(self) -> float:
        """Return the CPU time [s] of the program, 0 if Lapwing has not started it."""
        return self._program.cpu() if self._program else 0.0

    def _patience(self, timeout: float) -> Patience:
        return Patience(timeout, self.pid)

    def _check_program(self) -> None:
        if self._program:
            self._program.check(f" at t = {self._time:.3f} s")

    def _check(self, patience: Patience, problem: str, advice: str) -> None:
        """Raise FirmwareError if the program has ended or the time-out has passed."""
        self._check_program()
        if patience.over:
            self._fail(f"{problem} for {patience.timeout:g} s", advice)

    def _fail(self, problem: str, advice: str) -> NoReturn:
        raise FirmwareError(f"{self._setup.firmware}: {problem} at t = {self._time:.3f} s; {advice}")


def _end_with_parent() -> None:
    """Let the kernel end this process when its parent is killed."""
    _PRCTL(_DEATH_SIGNAL, signal.SIGKILL)


_PRCTL: Callable[[int, int], int] = ctypes.CDLL(None, use_errno=True).prctl if sys.platform == "linux" else lambda *_: 0
