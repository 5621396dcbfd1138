"""Requests to end a process of a run: signals, the end of its launcher, the loss of its run monitor."""

import os
import signal
import threading
import time

from lapwing.cosim.access.private_sockets import remove
from lapwing.cosim.run_errors import END_SIGNAL
from lapwing.cosim.transport.bus import ZenohBus

ORPHANED = 10.0  # [s] from the end of the launcher to the forced end of this process


class Stopped(Exception):
    """This process was requested to end."""


class StopRequest:
    """State of the request to end.

    Attributes:
        stopping: True once any request has arrived.
        terminated: True after SIGTERM, which does not come from the launcher.
        orphaned: True after the launcher has exited.
        abandoned: name of the watched participant that has left, "" if none has.
        supervised: True if a launcher or a run monitor ends this process when the run fails, or by leaving itself.
    """

    def __init__(self) -> None:
        self.stopping = self.terminated = self.orphaned = self.supervised = False
        self.abandoned = ""

    def handle_signals(self) -> None:
        """Stop at the launcher's signal and at SIGTERM. Ignore SIGINT, which the launcher handles for all processes."""
        signal.signal(END_SIGNAL, self._stop)
        signal.signal(signal.SIGTERM, self._terminate)
        signal.signal(signal.SIGINT, signal.SIG_IGN)

    def _stop(self, *_: object) -> None:
        self.stopping = True

    def _terminate(self, *_: object) -> None:
        self.stopping = self.terminated = True

    def stop_with_parent(self, endpoint: str) -> None:
        """Stop when the launcher, which holds the other end of standard input, has exited.

        A process that does not stop in time, for example while it compiles, removes the folder of its private
        `endpoint` and exits.
        """

        def watch() -> None:
            while os.read(0, 1):
                pass
            self.orphaned = self.stopping = True
            time.sleep(ORPHANED)
            remove(endpoint)
            os._exit(1)

        self.supervised = True
        threading.Thread(target=watch, daemon=True).start()

    def stop_when_gone(self, bus: ZenohBus, key: str) -> None:
        """Stop when the participant with this liveliness key has left the run."""

        def on_change(_: str, alive: bool) -> None:
            if not (alive or self.stopping):
                self.abandoned, self.stopping = key.rpartition("/")[2], True

        self.supervised = True
        bus.watch_liveliness(key, on_change)
