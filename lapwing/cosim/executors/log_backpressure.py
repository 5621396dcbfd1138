"""Log backpressure: the clock owner waits for a slow disk, so that memory stays bounded."""

import struct

from lapwing.cosim.executors.participant import Participant
from lapwing.cosim.transport.bus import ZenohBus
from lapwing.cosim.transport.bus_keys import RECORDED_KEY

AHEAD = 8192  # ticks that the run of one vehicle may be ahead of its log: some 20 MB; of several fewer
LEAST = 2048  # ticks, of however many vehicles
LOOK = 256  # ticks between two looks
_PROGRESS = struct.Struct("<q?")  # tick before which all is recorded, whether the disk is waited for


class LogProgressPublisher:
    """Publishes, for the recorder of a run, how far its log is."""

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
        """Listen to the recorder of the run that `process` owns the time of."""
        self._process = process
        self._get = process.bus.receive(process.participants.senders(RECORDED_KEY, [recorder])).get
        self._recorded: int | None = None
        self._ahead = max(LEAST, AHEAD // len(process.setup.vehicles))

    def wait_for_log(self, tick: int) -> None:
        """Return when `tick` may be stepped.

        Raises:
            Stopped: asked to end meanwhile.
        """
        if tick % LOOK:
            return
        while news := self._get(0.0):
            self._recorded = _PROGRESS.unpack(news[1])[0]
        while self._recorded is not None and tick - self._recorded >= self._ahead:
            news = self._process.wait_with_status(self._get, lambda: f"the log, recorded up to tick {self._recorded}")
            self._recorded = _PROGRESS.unpack(news[1])[0]
