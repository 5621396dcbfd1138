"""Configurations of firmware links for tests with scripted peers."""

import os
import socket
import threading
from contextlib import ExitStack, suppress

from lapwing.services.common.firmware.setup import FirmwareSetup

HOST = "127.0.0.1"


def free_instance(*ports):
    """Return an instance whose ports are free; a port is (kind, default, stride)."""
    worker = int(os.environ.get("PYTEST_XDIST_WORKER", "gw0")[2:])
    for instance in range(30 + 10 * (worker % 7), 100):
        with ExitStack() as stack, suppress(OSError):
            for kind, default, stride in ports:
                s = stack.enter_context(socket.socket(socket.AF_INET, kind))
                s.bind((HOST, default + stride * instance))
            return instance
    raise OSError("no free ports")


def firmware_setup(firmware, own, instance, **changed):
    """Return the configuration of a link with steps of 4 ms that waits for a peer."""
    setup = FirmwareSetup(
        firmware, (), "", {}, HOST, 0, instance, False, 20.0, 5.0, {}, "", (0, 2, 1, 3), 11.1,
        (0.0, 0.0, 0.11), 0.004, 4_000_000, 1, 25, (), (), own,
    )  # fmt: skip
    return setup._replace(**changed)


class Background:
    """A function in a thread whose exception the test sees."""

    def __init__(self, function, *arguments):
        """Start it."""
        self.result = self.error = None

        def run():
            try:
                self.result = function(*arguments)
            except BaseException as error:
                self.error = error

        self._thread = threading.Thread(target=run, daemon=True)
        self._thread.start()

    def join(self, timeout=60.0):
        """Wait for its end, and return its result."""
        self._thread.join(timeout)
        assert not self._thread.is_alive()
        if self.error:
            raise self.error
        return self.result


def never(_):
    """Wait without end of the run."""
