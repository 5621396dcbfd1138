"""Program of a firmware, started in its own process group and terminated with the group, and the claim of its ports."""

import ctypes
import functools
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Collection, Sequence
from contextlib import suppress
from pathlib import Path
from typing import IO, NamedTuple

from lapwing.cosim.processes.patience import process_state
from lapwing.cosim.processes.shared_core import bind, cores_at_start, process_tree, total_cpu_time
from lapwing.cosim.run_errors import LockStepError
from lapwing.services.common.firmware.firmware_config import FirmwareConfig
from lapwing.services.common.firmware.repeatable import Repeatable

GRACE = 2.0  # [s] from SIGTERM to SIGKILL
TAIL = 3  # last lines of the output in a message
IN_USE = re.compile("bind|in use|already running", re.IGNORECASE)  # in the output of such a program
QUOTE = "; its last output: "
# ends with its standard input, also if Lapwing is killed; the program may still write for a moment
_REMOVE = 'read _; for _ in 1 2 3 4 5 6 7 8 9; do rm -rf "$0"; [ -e "$0" ] || exit; sleep 0.2; done'
_DEATH_SIGNAL = 1  # PR_SET_PDEATHSIG
UDP, TCP = socket.SOCK_DGRAM, socket.SOCK_STREAM


class FirmwareError(LockStepError):
    """Error of a firmware that stalls or violates its protocol; the text has its name, the time and a remedy."""


class PortInUseError(FirmwareError):
    """A port of an instance is in use."""


class OwnPort(NamedTuple):
    """Port that the program opens."""

    kind: int  # UDP or TCP
    default: int  # of instance 0
    stride: int = 1  # between two instances


def bound_socket(firmware: str, kind: int, host: str, port: int, advice: str) -> socket.socket:
    """Return a socket of the kind UDP or TCP that is bound to a port.

    Raises:
        PortInUseError: the port is in use; the text ends with `advice`.
    """
    result = socket.socket(socket.AF_INET, kind)
    try:
        if kind == TCP:  # a port of a connection that has just ended is free
            result.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        result.bind((host, port))
    except OSError as error:
        result.close()
        message = f"{firmware}: cannot listen on {'tcp' if kind == TCP else 'udp'} {host}:{port} ({error.strerror})"
        raise PortInUseError(f"{message}; {advice}") from None
    return result


def owner_of_port(kind: int, port: int) -> int | None:
    """Return the process on this machine with a socket on a local port, None if it cannot be found."""
    with suppress(OSError, IndexError):
        table = Path("/proc/net/tcp" if kind == TCP else "/proc/net/udp").read_text()
        lines = [line.split() for line in table.splitlines()[1:]]
        names = {f"socket:[{words[9]}]" for words in lines if int(words[1].rpartition(":")[2], 16) == port}
        for folder in Path("/proc").glob("[0-9]*/fd"):
            with suppress(OSError):  # it has ended, or belongs to another user
                if any(os.readlink(entry) in names for entry in folder.iterdir()):
                    return int(folder.parent.name)
    return None


class Program:
    """The firmware's program, if Lapwing starts it."""

    def __init__(
        self,
        config: FirmwareConfig,
        arguments: Sequence[str] = (),
        files: dict[str, str] | None = None,
        log: Path | None = None,
        own_logs: str = "",
        repeatable: Repeatable | None = None,
    ):
        """Start the program.

        Args:
            config: command, working directory and environment.
            arguments: further arguments.
            files: content of files to write into the working directory, by name.
            log: log of the run, beside which output and logs of the program are kept.
            own_logs: pattern of the program's logs in its working directory.
            repeatable: library to preload.

        Raises:
            FirmwareError: the program or the directory does not exist.
        """
        self._firmware, self._log, self._own_logs = config.firmware, log, own_logs
        self._folder = Path(tempfile.mkdtemp(prefix=f"lapwing_{config.firmware}_"))
        self._remover = subprocess.Popen(["sh", "-c", _REMOVE, self._folder], stdin=subprocess.PIPE, cwd="/",
                                         start_new_session=True)  # fmt: skip
        self.directory = Path(config.directory or self._folder)
        self.output = log.with_suffix(f".{config.firmware}.txt") if log else self._folder / "output.txt"
        self._started_at = time.time()
        try:
            for name, content in (files or {}).items():
                (self.directory / name).write_text(content)
            self._file = self.output.open("wb", buffering=0)
            self._command, self._environment = [*config.command, *arguments], config.environment
            self._shell = config.shell
            self._launch(repeatable)
        except OSError as error:
            self._discard()
            where = error.filename or config.command[0]
            message = f"{config.firmware}: cannot start {where} ({error.strerror})"
            raise FirmwareError(f"{message}; check autopilot.command and autopilot.directory") from None

    def _launch(self, repeatable: Repeatable | None) -> None:
        self.repeatable, self.cores = repeatable, cores_at_start(in_turns=repeatable is not None)
        self._process = subprocess.Popen(
            self._command,
            cwd=self.directory,
            env={**os.environ, **self._environment, **(repeatable.environment if repeatable else {})},
            pass_fds=(repeatable.child.fileno(),) if repeatable else (),
            stdin=None if self._shell else subprocess.DEVNULL,
            stdout=subprocess.PIPE if self._shell else self._file,
            stderr=subprocess.STDOUT,
            start_new_session=True,
            preexec_fn=functools.partial(_prepare_child, self.cores) if sys.platform == "linux" else None,
        )
        if self._process.stdout:
            self._copying = threading.Thread(target=_copy, args=(self._process.stdout, self._file), daemon=True)
            self._copying.start()

    @property
    def pid(self) -> int:
        """Process id, also of its process group."""
        return self._process.pid

    @property
    def running(self) -> bool:
        """True until the program ends."""
        return self._process.poll() is None

    def restart(self, repeatable: Repeatable | None = None) -> None:
        """Start the program again, after it has ended."""
        self._process.wait()
        self._launch(repeatable)

    def check(self, when: str = "", starting: bool = False) -> None:
        """Raise FirmwareError if the program has ended, PortInUseError if it is `starting` and named that reason."""
        code = self._process.poll()
        if code is not None:
            reason = f"signal {-code}" if code < 0 else f"exit code {code}"
            kind = PortInUseError if starting and IN_USE.search(self.text()) else FirmwareError
            raise kind(f"{self._firmware}: the program ended ({reason}){when}{self.quote() or ' without output'}")

    def text(self) -> str:
        """Return the output so far."""
        return self.output.read_text(errors="replace").strip()

    def quote(self) -> str:
        """Return the last lines of the output for a message, "" without output."""
        lines = [line.strip() for line in self.text().splitlines() if line.strip()]
        more = f" ({self.output} has all)" if self._log and len(lines) > TAIL else ""
        return f"{QUOTE}{' | '.join(lines[-TAIL:])}{more}" if lines else ""

    def cpu(self) -> float:
        """Return the CPU time [s] that it and its descendants use, or 0 if the system does not report it."""
        return sum(map(total_cpu_time, process_tree(self.pid)))

    def close(self) -> None:
        """End the program and its children, keep its logs, and remove its temporary folder."""
        self.stop()
        self._keep_logs()
        self._discard()

    def stop(self) -> None:
        """End the program and its children, by request, then by force; their ports are free afterwards."""
        if self.repeatable:
            self.repeatable.close()
        tree = process_tree(self.pid)
        self._signal(signal.SIGTERM)
        _wait_until(lambda: not self.running)
        self._signal(signal.SIGKILL)
        self._process.wait()
        _wait_until(lambda: all(process_state(pid) in ("", "Z", "X") for pid in tree[1:]))

    def _keep_logs(self) -> None:
        """Put the logs that the program has written beside the log of the run."""
        if self._log is None or not self._own_logs:
            return
        with suppress(OSError):  # a full disk must not hide the result of the run
            found = [path for path in self.directory.glob(self._own_logs) if path.stat().st_mtime >= self._started_at]
            for number, path in enumerate(sorted(found, key=lambda path: path.stat().st_mtime)):
                ending = f".{number + 1}" if number else ""
                target = self._log.with_suffix(f".{self._firmware}{ending}{path.suffix.lower()}")
                (shutil.move if self.directory == self._folder else shutil.copy)(path, target)

    def _signal(self, number: int) -> None:
        with suppress(ProcessLookupError, PermissionError):
            os.killpg(self.pid, number)

    def _discard(self) -> None:
        if hasattr(self, "_copying"):
            self._copying.join(GRACE)
        if hasattr(self, "_file"):
            self._file.close()
        self._remover.communicate()


def _copy(output: IO[bytes], file: IO[bytes]) -> None:
    """Write the output of the program to a file and to the standard output."""
    with suppress(ValueError):  # the file is closed: a process that has survived the program still writes
        while data := os.read(output.fileno(), 4096):
            file.write(data)
            sys.stdout.buffer.write(data)
            sys.stdout.flush()


def _wait_until(condition: Callable[[], bool]) -> None:
    deadline = time.monotonic() + GRACE
    while not condition() and time.monotonic() < deadline:
        time.sleep(0.01)


def _prepare_child(cores: Collection[int]) -> None:
    """Bind this process to cores, and let the kernel end it when its parent is killed."""
    bind(0, cores)
    _PRCTL(_DEATH_SIGNAL, signal.SIGKILL)


_PRCTL: Callable[[int, int], int] = ctypes.CDLL(None, use_errno=True).prctl if sys.platform == "linux" else lambda *_: 0
