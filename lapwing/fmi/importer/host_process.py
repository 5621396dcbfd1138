"""Process of an FMU as seen from the run, which survives crashes and hangs of foreign machine code."""

import contextlib
import json
import os
import select
import shutil
import signal
import struct
import subprocess
import sys
import tempfile
import weakref
from collections.abc import Callable

import numpy as np

from lapwing.cosim.processes.patience import Patience
from lapwing.fmi.importer.service_config import FmuConfig

STARTUP = 300.0  # [s] limit to load, compile and initialise the FMU
LOOK = 0.1  # [s] between two checks of the processor time of the process during a wait
LENGTH = struct.Struct("<q")


class HostError(Exception):
    """Failure of an FMU; the text describes it."""


class HostProcess:
    """Process that runs one FMU. It is connected by two pipes, which are faster than a socket.

    Attributes:
        requests, replies: file descriptors of the pipes.
    """

    def __init__(
        self,
        fmu: FmuConfig,
        request: np.ndarray,
        reply: np.ndarray,
        report_wait: Callable[[str], None] = lambda text: None,
    ):
        """Start the process and instantiate the FMU.

        Args:
            fmu: configuration of the FMU.
            request: array of doubles of a request: time [s], step [s] (negative: initialise), inputs.
            reply: array of doubles of an answer: length of an error text [bytes], outputs.
            report_wait: function that is called with a text during long waits.

        Raises:
            HostError: the file has changed, or the FMU cannot be instantiated.
        """
        self._timeout, self._request, self._reply = fmu.timeout, request, reply
        self._report_wait, self._name = report_wait, f"services.{fmu.name}"
        folder = tempfile.mkdtemp(prefix="lapwing-fmu-")
        child_requests, self.requests = os.pipe()
        self.replies, child_replies = os.pipe()
        channels = child_requests, child_replies
        self._process = subprocess.Popen(
            [sys.executable, "-m", "lapwing.fmi.importer.host", *map(str, channels)],
            pass_fds=channels, stdin=subprocess.DEVNULL, stdout=sys.stderr.fileno(),
        )  # fmt: skip
        for each in channels:
            os.close(each)
        self._end = weakref.finalize(self, _end, self._process, (self.requests, self.replies), folder)
        poll = select.poll()
        poll.register(self.replies, select.POLLIN)
        self._poll = poll.poll
        text = json.dumps({**fmu._asdict(), "folder": folder}).encode()
        self._limit = STARTUP
        self._send(memoryview(LENGTH.pack(len(text)) + text))

    def finish(self, sent: int, received: int) -> None:
        """Send the rest of a request and receive the rest of its answer.

        Args:
            sent: bytes of the request that have been sent; not positive: none.
            received: bytes of the answer that have been received; not positive: none.

        Raises:
            HostError: the FMU crashed, hung or reported an error.
        """
        self._send(self._request.data.cast("B")[max(sent, 0) :])
        self._receive(self._reply.data.cast("B")[max(received, 0) :])
        if self._reply[0]:
            text = bytearray(int(self._reply[0]))
            self._receive(memoryview(text))
            self._end()
            raise HostError(text.decode(errors="replace"))
        self._limit = self._timeout  # [s] limit of the next request

    def _send(self, data: memoryview) -> None:
        try:
            while data:
                data = data[os.write(self.requests, data) :]
        except OSError:
            raise self._crashed() from None

    def _receive(self, data: memoryview) -> None:
        patience = Patience(self._limit, self._process.pid)
        while data:
            while not self._poll(1e3 * min(LOOK, 0.25 * self._limit)):
                self._report_wait(f"the FMU of {self._name}")
                if patience.over:
                    self._process.kill()
                    self._end()
                    raise HostError(f"no answer for {self._limit:g} s")
            size = os.readv(self.replies, [data])
            if not size:
                raise self._crashed()
            data = data[size:]

    def _crashed(self) -> HostError:
        try:
            code = self._process.wait(self._timeout)
        except subprocess.TimeoutExpired:
            self._process.kill()
            code = self._process.wait()
        self._end()
        return HostError(f"crashed ({signal.Signals(-code).name if code < 0 else f'exit code {code}'})")


def _end(process: subprocess.Popen, channels: tuple[int, int], folder: str) -> None:
    """Close the pipes, which ends the process, and remove its files."""
    for each in channels:
        os.close(each)
    with contextlib.suppress(subprocess.TimeoutExpired):
        process.wait(1.0)
    if process.poll() is None:
        process.kill()
        process.wait()
    shutil.rmtree(folder, ignore_errors=True)
