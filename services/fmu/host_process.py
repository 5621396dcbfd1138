"""The process of an FMU, as seen from the run, which continues if foreign machine code crashes or hangs."""

import contextlib
import json
import shutil
import signal
import socket
import struct
import subprocess
import sys
import tempfile
import weakref
from collections.abc import Sequence

from lapwing.services.fmu.service_config import FmuConfig

STARTUP = 300.0  # [s] to load the FMU, compile for model exchange, and initialise it
LENGTH = struct.Struct("<q")


class HostError(Exception):
    """Failure of an FMU; the text says how it failed."""


class HostProcess:
    """A process that runs one FMU."""

    def __init__(self, fmu: FmuConfig):
        """Start the process and instantiate the FMU.

        Raises:
            HostError: the file has changed, or cannot be instantiated.
        """
        own, child = socket.socketpair()
        self._socket, self._timeout = own, fmu.timeout
        self._request = struct.Struct(f"<{2 + len(fmu.inputs)}d")
        self._reply = struct.Struct(f"<q{len(fmu.outputs)}d")
        folder = tempfile.mkdtemp(prefix="lapwing-fmu-")
        self._process = subprocess.Popen(
            [sys.executable, "-m", "lapwing.services.fmu.host", str(child.fileno())],
            pass_fds=[child.fileno()], stdin=subprocess.DEVNULL, stdout=sys.stderr.fileno(),
        )  # fmt: skip
        child.close()
        self._end = weakref.finalize(self, _end, self._process, own, folder)
        text = json.dumps({**fmu._asdict(), "folder": folder}).encode()
        self._limit(STARTUP)
        self._send(LENGTH.pack(len(text)) + text)

    def step(self, time: float, step: float, inputs: Sequence[float]) -> tuple[float, ...]:
        """Set inputs, step from `time` by `step` [s], and return the outputs; a negative step initialises.

        Raises:
            HostError: the FMU crashed, hung or reported an error.
        """
        self._send(self._request.pack(time, step, *inputs))
        status, *outputs = self._reply.unpack(self._receive(self._reply.size))
        if step < 0.0:
            self._limit(self._timeout)
        if status:
            text = self._receive(status).decode(errors="replace")
            self._end()
            raise HostError(text)
        return tuple(outputs)

    def _limit(self, seconds: float) -> None:
        """Limit the waits for the process. A limit in the kernel needs no further system call at each step."""
        self._waits = seconds
        limit = struct.pack("@ll", int(seconds), int(seconds % 1.0 * 1e6))
        for option in (socket.SO_RCVTIMEO, socket.SO_SNDTIMEO):
            self._socket.setsockopt(socket.SOL_SOCKET, option, limit)

    def _send(self, data: bytes) -> None:
        try:
            self._socket.sendall(data)
        except OSError:
            raise self._crashed() from None

    def _receive(self, size: int) -> bytes:
        data = self._part(size)
        while len(data) < size:
            data += self._part(size - len(data))
        return data

    def _part(self, size: int) -> bytes:
        try:
            part = self._socket.recv(size)
        except BlockingIOError:  # the limit is over
            self._process.kill()
            self._end()
            raise HostError(f"no answer for {self._waits:g} s") from None
        except OSError:
            part = b""
        if not part:
            raise self._crashed()
        return part

    def _crashed(self) -> HostError:
        try:
            code = self._process.wait(self._timeout)
        except subprocess.TimeoutExpired:
            self._process.kill()
            code = self._process.wait()
        self._end()
        return HostError(f"crashed ({signal.Signals(-code).name if code < 0 else f'exit code {code}'})")


def _end(process: subprocess.Popen, own: socket.socket, folder: str) -> None:
    """End the process, which leaves when its socket closes, and remove its files."""
    own.close()
    with contextlib.suppress(subprocess.TimeoutExpired):
        process.wait(1.0)
    if process.poll() is None:
        process.kill()
        process.wait()
    shutil.rmtree(folder, ignore_errors=True)
