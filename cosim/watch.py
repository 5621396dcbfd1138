"""What somebody who watches a run sees of it on the bus."""

import time
from collections.abc import Iterable

from cosim.bundle import unpack_batch
from cosim.bus import ZenohBus
from cosim.keys import ALIVE_KEY, BATCH_KEY, COMPILING_KEY, DIVERGED_KEY, WAITING_KEY
from messages.topics import Topic

STALL = 2.5  # [s] without any message after which somebody is held to be frozen
WATCHER = "mission"  # whoever watches, among the participants
HEARD = (BATCH_KEY, WAITING_KEY, COMPILING_KEY, DIVERGED_KEY)


class Watch:
    """What a launcher sees of a run: who is there, how far it is, what it waits for."""

    def __init__(self, bus: ZenohBus, key_prefix: str):
        """Follow the batches of all services; `newest` holds the newest payload of each topic."""
        self._key_prefix = key_prefix
        self.newest: dict[Topic, bytes] = {}
        self.waiting: dict[str, str] = {}
        self.compiling = False  # somebody compiles kernels
        self.diverged = False  # a state is no longer sound: the run ends, and its log says why
        self.present: set[str] = set()
        self.gone: set[str] = set()
        self.time_ns = 0  # up to which everybody who has spoken has come
        self._times: dict[str, int] = {}
        self.began: float | None = None  # [s] of the monotonic clock, at the first batch
        self.wall = 0.0  # [s] from the first batch to the newest
        self.ended = False  # somebody has handed over the last tick
        self.last_news = time.monotonic()
        self._news = bus.subscribe(*(f"{key_prefix}/{key}/*" for key in HEARD))
        bus.watch_alive(f"{key_prefix}/{ALIVE_KEY}/*", self._alive)

    def _alive(self, key: str, alive: bool) -> None:
        name = key.rsplit("/", 1)[1]
        if alive:
            self.present.add(name)
            self.gone.discard(name)
        elif name in self.present:
            self.gone.add(name)

    def poll(self, seconds: float) -> None:
        """Take in what arrives during `seconds`."""
        until = time.monotonic() + seconds
        while (left := until - time.monotonic()) > 0:
            news = self._news.get_with_key(timeout=left)
            if news is None:
                return
            key, time_ns, payload = news
            head, _, name = key.removeprefix(f"{self._key_prefix}/").partition("/")
            if head == COMPILING_KEY:
                self.compiling = True
                continue
            if head == DIVERGED_KEY:
                self.diverged = True
                continue
            if head == WAITING_KEY:
                self.waiting[name] = payload.decode()
                continue
            self.last_news = time.monotonic()
            self.waiting.clear()
            if not payload:
                self.ended = True
                continue
            self.began = self.began or self.last_news
            self.wall = self.last_news - self.began
            self._times[name] = time_ns
            self.time_ns = min(self._times.values())
            for page in unpack_batch(payload)[1]:
                self.newest[page.topic] = page.payloads[-1].tobytes()

    def frozen(self, names: Iterable[str]) -> str | None:
        """A sentence that names who holds up the run, None while it goes on."""
        if self.ended or time.monotonic() - self.last_news < STALL:
            return None
        silent = sorted(set(names) - set(self.waiting))
        where = f"at t = {self.time_ns * 1e-9:.3f} s"
        if silent:
            return f"{', '.join(silent)}: no answer since {STALL:g} s, {where}"
        return f"the run stands still {where}: " + "; ".join(f"{n} waits for {w}" for n, w in self.waiting.items())
