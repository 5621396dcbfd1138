"""Log backpressure: the clock owner waits for a slow disk, so that memory stays bounded."""

import struct

from lapwing.cosim.executors.participant import Participant
from lapwing.cosim.transport.bus import ZenohBus
from lapwing.cosim.transport.bus_keys import RECORDED_KEY

AHEAD = 8192  # [ticks] limit of a run's lead over its log (one vehicle), about 20 MB; fewer with several vehicles
LEAST = 2048  # [ticks] lower limit with many vehicles
LOOK = 256  # [ticks] between two checks
_PROGRESS = struct.Struct("<q?")  # first tick that is not recorded; True while the recorder waits for the disk


class LogProgressPublisher:
    """Publisher of the progress of a run's log; the recorder uses it."""

    def __init__(self, bus: ZenohBus, key_prefix: str, name: str):
        """Publish for the recorder `name`."""
        self._put = bus.publisher(f"{key_prefix}/{RECORDED_KEY}/{name}")
        self._recorded = 0

    def recorded(self, tick: int) -> None:
        """Publish that all messages before this tick are in the log."""
        self._recorded = tick
        self._put(_PROGRESS.pack(tick, False), 0)

    def end(self) -> None:
        """Publish that the log is complete."""
        self._put(b"", 0)

    def waiting(self) -> None:
        """Publish that the recorder waits for the disk."""
        self._put(_PROGRESS.pack(self._recorded, True), 0)


def waits_for_disk(payload: bytes) -> bool:
    """Return True if the recorder waits for the disk, according to a payload of a `LogProgressPublisher`."""
    return bool(payload) and _PROGRESS.unpack(payload)[1]


class LogBackpressure:
    """Blocks the run while it is too far ahead of its log; a run without a recorder is never blocked."""

    def __init__(self, process: Participant, recorder: str):
        """Subscribe to the progress of `recorder`; `process` is the clock owner of the run."""
        self._process = process
        self._get = process.bus.receive(process.participants.senders(RECORDED_KEY, [recorder])).get
        self._recorded: int | None = None
        self._ahead = max(LEAST, AHEAD // len(process.config.vehicles))

    def wait_for_log(self, tick: int) -> None:
        """Wait until `tick` may be stepped.

        Raises:
            Stopped: requested to stop during the wait.
        """
        if tick % LOOK:
            return
        while message := self._get(0.0):
            self._recorded = _PROGRESS.unpack(message[1])[0]
        while self._recorded is not None and tick - self._recorded >= self._ahead:
            message = self._process.wait_with_status(
                self._get, lambda: f"the log, recorded up to tick {self._recorded}"
            )
            self._recorded = _PROGRESS.unpack(message[1])[0]
