"""Run monitor: progress, stalls and end of a run, as observed on the bus."""

import time
from collections.abc import Callable, Iterable

from lapwing.cosim.access.publisher_ids import PublisherIds
from lapwing.cosim.diagram.topic_encoder import RecordBatch
from lapwing.cosim.executors.log_backpressure import waits_for_disk
from lapwing.cosim.transport.bus import ZenohBus
from lapwing.cosim.transport.bus_keys import (
    ALIVE_KEY,
    BATCH_KEY,
    BLOCK_TIME_KEY,
    COMPILING_KEY,
    DIVERGED_KEY,
    ENDED_KEY,
    HEARD_KEY,
    LOGGED_KEY,
    OUTSIDE_KEY,
    RECORDED_KEY,
    REFUSED_KEY,
    WAITING_KEY,
)
from lapwing.cosim.transport.packets import unpack_log_packet
from lapwing.messages.topics import Topic

STALL = 2.5  # [s] without a message after which a participant counts as stalled
LONGEST = 60.0  # [s] instead of `STALL` while processes wait for a processor
MONITOR = "mission"  # name of the run monitor among the participants
MONITORED_KEYS = (
    BATCH_KEY,
    BLOCK_TIME_KEY,
    WAITING_KEY,
    OUTSIDE_KEY,
    COMPILING_KEY,
    DIVERGED_KEY,
    ENDED_KEY,
    RECORDED_KEY,
    REFUSED_KEY,
)


class RunMonitor:
    """Observed state of a run: present participants, progress, and what they wait for."""

    def __init__(
        self,
        bus: ZenohBus,
        participants: PublisherIds,
        names: Iterable[str],
        patience: float = STALL,
        services: Iterable[str] = (),
    ):
        """Follow a run; `newest` holds the newest payload of each topic.

        Args:
            bus: the session.
            participants: publisher GIDs of the run.
            names: names of the participants.
            patience: time [s] without a message after which a participant counts as stalled.
            services: publishers of log packets; each waits until its last one is confirmed.
        """
        self._services = frozenset(services)
        self._unfinished = set(services)  # services whose last message has not arrived
        self.confirmed: set[str] = set()  # participants that have received the last message of every service
        self._logged = False  # the recorder's last message has arrived
        self._patience = patience
        self._bus, self._key_prefix, names = bus, participants.key_prefix, list(names)
        self.newest: dict[Topic, bytes] = {}
        self.on_batches: Callable[[list[RecordBatch]], None] | None = None  # called with all messages
        self.waiting: dict[str, str] = {}
        self.outside = ""  # program outside the run that a service waits for
        self.compiling = False  # a participant compiles kernels
        self.diverged = False  # a state is invalid: the run ends with the reason in its log
        self.slow_disk = False  # True if the recorder has waited for the disk
        self.present: set[str] = set()
        self.left: set[str] = set()  # participants that have left the run
        self.time_ns = 0  # time that all reporting services have reached
        self._times: dict[str, int] = {}
        self.start: float | None = None  # [s] of the monotonic clock, at the first log packet
        self.wall = 0.0  # [s] from the first log packet to the newest
        self.ended = False  # a service has published its last log packet
        self.outcome: str | None = None  # "" if the run was completed, the reason if it ended early; None: unknown
        self.block_times: dict[str, float] = {}  # [s] of processor time in the blocks of a service, at its end
        self._rejected: dict[str, int] = {}  # numbers of rejected messages by participant
        self.last_news = time.monotonic()
        senders: dict[str, bytes | None] = {}
        for key in MONITORED_KEYS:
            senders |= participants.senders(key, names)
        self._news = bus.receive(senders)
        bus.watch_liveliness(f"{self._key_prefix}/{ALIVE_KEY}/*", self._note_presence)
        bus.watch_liveliness(f"{self._key_prefix}/{HEARD_KEY}/*", self._note_confirmation)

    def _note_presence(self, key: str, alive: bool) -> None:
        name = key.rsplit("/", 1)[1]
        if alive:
            self.present.add(name)
            self.left.discard(name)
        elif name in self.present:
            self.left.add(name)

    def _note_confirmation(self, key: str, alive: bool) -> None:
        if alive:
            self.confirmed.add(key.rsplit("/", 1)[1])
            self.last_news = time.monotonic()

    def poll(self, seconds: float) -> None:
        """Read the messages that arrive within `seconds`, then all that are pending.

        On a busy machine the time may pass before a message is read; without the pending ones the monitor would fall
        behind more and more.
        """
        deadline = time.monotonic() + seconds
        while (remaining := deadline - time.monotonic()) > 0:
            message = self._news.get_with_key(timeout=remaining)
            if message is None:
                return
            self._read(*message)
        for _ in range(self._news.pending):
            if (message := self._news.get_with_key(timeout=0.0)) is not None:
                self._read(*message)

    def _read(self, key: str, time_ns: int, payload: bytes) -> None:
        head, _, name = key.removeprefix(f"{self._key_prefix}/").partition("/")
        if head == BATCH_KEY:
            self._read_log_packet(name, time_ns, payload)
        elif head == COMPILING_KEY:
            self.compiling = True
        elif head == DIVERGED_KEY:
            self.diverged = True
        elif head == BLOCK_TIME_KEY:
            self.block_times[name] = float(payload)
        elif head == WAITING_KEY:
            self.waiting[name] = payload.decode(errors="replace")
        elif head == OUTSIDE_KEY:
            self.last_news = time.monotonic()  # the service has its own time-out
            self.outside = payload.decode(errors="replace")
        elif head == RECORDED_KEY:
            self._read_log_progress(payload)
        elif head == ENDED_KEY:
            self.outcome = self.outcome or payload.decode(errors="replace")  # the first cause counts
        elif head == REFUSED_KEY and payload.isdigit():
            self._rejected[name] = int(payload)

    def _read_log_progress(self, payload: bytes) -> None:
        if self._logged:
            return  # the recorder repeats its last message, which is no progress
        self.last_news = time.monotonic()
        self.slow_disk = self.slow_disk or waits_for_disk(payload)
        if not payload:
            self._logged = True
            self._declare(LOGGED_KEY)

    def _read_log_packet(self, name: str, time_ns: int, payload: bytes) -> None:
        if not payload:
            self._note_last_packet(name)
            return
        self.last_news = time.monotonic()
        self.waiting.clear()
        self.outside = ""
        self.start = self.start or self.last_news
        self.wall = self.last_news - self.start
        self._times[name] = max(time_ns, self._times.get(name, 0))
        self.time_ns = min(self._times.values())
        _, _, batches = unpack_log_packet(payload)
        for batch in batches:
            self.newest[batch.topic] = batch.payloads[-1].tobytes()
        if self.on_batches:
            self.on_batches(batches)

    def _note_last_packet(self, name: str) -> None:
        if name in self._unfinished:
            self._unfinished.discard(name)
            self.last_news = time.monotonic()
            self.waiting.clear()
            if not self._unfinished:
                self._declare(HEARD_KEY)
        self.ended = True

    def _declare(self, key: str) -> None:
        """Confirm last messages; their senders wait for that before they leave."""
        self._bus.declare_liveliness(f"{self._key_prefix}/{key}/{MONITOR}")

    def publish(self, key: str, time_ns: int, payload: bytes) -> None:
        """Publish a message for viewers, on a key below the prefix of the run; after its end, do nothing."""
        with self._bus.until_closed():
            self._bus.publisher(f"{self._key_prefix}/{key}", drops=True)(payload, time_ns)

    @property
    def complete(self) -> bool:
        """True if the last message of every service has arrived."""
        return self.ended and not self._unfinished

    @property
    def reporting_services(self) -> set[str]:
        """Services that have published log packets."""
        return set(self._times)

    @property
    def rejected(self) -> int:
        """Number of messages that all participants have reported as rejected."""
        return sum(self._rejected.values()) + self._bus.rejected

    def abort_message(self) -> str | None:
        """Return a description of an early end, None if the run completed or diverged."""
        if self.outcome == "" or self.diverged:
            return None
        cause = f": {self.outcome}" if self.outcome else ""
        return f"the run ended early at t = {self.time_ns * 1e-9:.3f} s{cause}"

    def waits(self, names: Iterable[str]) -> list[str]:
        """Return a text for each of these participants that has reported what it waits for."""
        return [f"{name} waits for {self.waiting[name]}" for name in names if name in self.waiting]

    def stall_message(
        self, names: Iterable[str], starved: Callable[[Iterable[str]], float] = lambda names: 0.0
    ) -> str | None:
        """Return a description of the participants that block the run, None while it proceeds.

        Args:
            names: participants that the run requires.
            starved: returns the time [s] that the named processes have waited for a processor since the last message,
                which does not count as silence.
        """
        silence = time.monotonic() - self.last_news
        if self.ended or silence < self._patience:
            return None
        silent = sorted(set(names) - set(self.waiting))
        # If all services wait, one of them may have its input but no processor; the router is always silent.
        suspects = silent if self._services.intersection(silent) or not self._services else names
        if silence < LONGEST and silence - starved(suspects or names) < self._patience:
            return None
        where = f"at t = {self.time_ns * 1e-9:.3f} s"
        if silent:
            return f"{', '.join(silent)}: no answer for {self._patience:g} s, {where}"
        return f"the run is blocked {where}: {'; '.join(self.waits(self.waiting))}"
