"""How far a run is ahead of its log: whoever owns time waits for a slow disk, so that memory stays bounded."""

import struct

from cosim.bus import ZenohBus
from cosim.keys import RECORDED_KEY
from cosim.process import Process

AHEAD = 8192  # ticks that the run of one vehicle may be ahead of its log: some 20 MB; of several fewer
LEAST = 2048  # ticks, of however many vehicles
LOOK = 256  # ticks between two looks
_PROGRESS = struct.Struct("<q?")  # tick before which all is recorded, whether the disk is waited for


class Teller:
    """Tells the others how far a log is."""

    def __init__(self, bus: ZenohBus, key_prefix: str, name: str):
        """Of the recorder `name`."""
        self._put = bus.publisher(f"{key_prefix}/{RECORDED_KEY}/{name}")
        self._recorded = 0

    def recorded(self, tick: int) -> None:
        """All before this tick is recorded."""
        self._recorded = tick
        self._put(_PROGRESS.pack(tick, False), 0)

    def waiting(self) -> None:
        """The disk is waited for."""
        self._put(_PROGRESS.pack(self._recorded, True), 0)


def waits_for_disk(payload: bytes) -> bool:
    """Whether this progress says that the disk is waited for."""
    return _PROGRESS.unpack(payload)[1]


class Backlog:
    """Holds the run while it is too far ahead of a log; a run that nobody records is never held."""

    def __init__(self, process: Process, recorder: str):
        """Listen to the recorder of the run that `process` owns the time of."""
        self._process = process
        self._get = process.bus.receive(process.participants.senders(RECORDED_KEY, [recorder])).get
        self._recorded: int | None = None
        self._ahead = max(LEAST, AHEAD // len(process.setup.vehicles))

    def resume(self, recorded: int) -> None:
        """All before this tick is recorded: hold the run from the first progress on that is not told any more."""
        self._recorded = recorded

    def hold(self, tick: int) -> None:
        """Return when `tick` may be stepped.

        Raises:
            Stopped: asked to end meanwhile.
        """
        if tick % LOOK:
            return
        while news := self._get(0.0):
            self._recorded = _PROGRESS.unpack(news[1])[0]
        while self._recorded is not None and tick - self._recorded >= self._ahead:
            news = self._process.patient(self._get, lambda: f"the log, recorded up to tick {self._recorded}")
            self._recorded = _PROGRESS.unpack(news[1])[0]
