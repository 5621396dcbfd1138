"""The process of an FMU, as seen from the run, which continues if foreign machine code crashes or hangs."""

import contextlib
import json
import math
import os
import select
import shutil
import signal
import struct
import subprocess
import sys
import tempfile
import weakref

from lapwing.services.fmu.service_config import FmuConfig

STARTUP = 300.0  # [s] to load the FMU, compile for model exchange, and initialise it
LENGTH = struct.Struct("<q")


class HostError(Exception):
    """Failure of an FMU; the text says how it failed."""


class HostProcess:
    """A process that runs one FMU. Two pipes connect it, which are faster than a socket.

    Attributes:
        inputs: doubles that the next step sets the inputs to.
        outputs: doubles that the last step has left.
    """

    def __init__(self, fmu: FmuConfig):
        """Start the process and instantiate the FMU.

        Raises:
            HostError: the file has changed, or cannot be instantiated.
        """
        self._timeout = fmu.timeout
        self._request, self._reply = bytearray(8 * (2 + len(fmu.inputs))), bytearray(8 * (1 + len(fmu.outputs)))
        numbers = memoryview(self._request).cast("d")
        self._moment, self.inputs = numbers[:2], numbers[2:]
        self._status = memoryview(self._reply).cast("q")[:1]
        self.outputs = memoryview(self._reply).cast("d")[1:]
        folder = tempfile.mkdtemp(prefix="lapwing-fmu-")
        child_requests, self._requests = os.pipe()
        self._replies, child_replies = os.pipe()
        channels = child_requests, child_replies
        self._process = subprocess.Popen(
            [sys.executable, "-m", "lapwing.services.fmu.host", *map(str, channels)],
            pass_fds=channels, stdin=subprocess.DEVNULL, stdout=sys.stderr.fileno(),
        )  # fmt: skip
        for each in channels:
            os.close(each)
        self._end = weakref.finalize(self, _end, self._process, (self._requests, self._replies), folder)
        poll = select.poll()
        poll.register(self._replies, select.POLLIN)
        self._poll = poll.poll
        text = json.dumps({**fmu._asdict(), "folder": folder}).encode()
        self._limit(STARTUP)
        self._send(LENGTH.pack(len(text)) + text)

    def step(self, time: float, step: float) -> None:
        """Set inputs, step from `time` by `step` [s], and read the outputs; a negative step initialises.

        Raises:
            HostError: the FMU crashed, hung or reported an error.
        """
        self._moment[0], self._moment[1] = time, step
        self._send(self._request)
        self._receive(self._reply)
        if step < 0.0:
            self._limit(self._timeout)
        if self._status[0]:
            text = bytearray(self._status[0])
            self._receive(text)
            self._end()
            raise HostError(text.decode(errors="replace"))

    def _limit(self, seconds: float) -> None:
        """Limit the waits for the process."""
        self._waits, self._wait_ms = seconds, math.ceil(1e3 * seconds)

    def _send(self, data: bytes | bytearray) -> None:
        try:
            sent = os.write(self._requests, data)
            while sent < len(data):
                sent += os.write(self._requests, memoryview(data)[sent:])
        except OSError:
            raise self._crashed() from None

    def _receive(self, data: bytearray) -> None:
        size = self._part(data)
        while size < len(data):
            size += self._part(memoryview(data)[size:])

    def _part(self, data: bytearray | memoryview) -> int:
        if not self._poll(self._wait_ms):
            self._process.kill()
            self._end()
            raise HostError(f"no answer for {self._waits:g} s")
        size = os.readv(self._replies, [data])
        if not size:
            raise self._crashed()
        return size

    def _crashed(self) -> HostError:
        try:
            code = self._process.wait(self._timeout)
        except subprocess.TimeoutExpired:
            self._process.kill()
            code = self._process.wait()
        self._end()
        return HostError(f"crashed ({signal.Signals(-code).name if code < 0 else f'exit code {code}'})")


def _end(process: subprocess.Popen, channels: tuple[int, int], folder: str) -> None:
    """End the process, which leaves when its pipes close, and remove its files."""
    for each in channels:
        os.close(each)
    with contextlib.suppress(subprocess.TimeoutExpired):
        process.wait(1.0)
    if process.poll() is None:
        process.kill()
        process.wait()
    shutil.rmtree(folder, ignore_errors=True)
