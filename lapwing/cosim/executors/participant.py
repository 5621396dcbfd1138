"""A participant of a run as a process of its own: it joins the others on the bus, and waits with them."""

import os
import signal
import threading
import time
from collections.abc import Callable, Collection, Sequence
from typing import TypeVar

from lapwing.cosim.access.private_sockets import remove
from lapwing.cosim.access.publisher_ids import PublisherIds
from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.config.run_config_message import pack, unpack
from lapwing.cosim.config.serialise import first_difference, from_json, to_json
from lapwing.cosim.diagram.block_diagram import Service
from lapwing.cosim.run_errors import END_SIGNAL, LockStepError
from lapwing.cosim.transport.bus import ZenohBus
from lapwing.cosim.transport.bus_keys import (
    ALIVE_KEY,
    COMPILING_KEY,
    HEARD_KEY,
    LOGGED_KEY,
    REFUSED_KEY,
    SETUP_KEY,
    WAITING_KEY,
)
from lapwing.cosim.transport.session_settings import LEASE_MS
from lapwing.cosim.transport.tcp_timeout import limit_silence
from lapwing.kernels import on_compile
from lapwing.messages.topics import Topic

POLL = 0.1  # [s] between two looks at whether to stop
PATIENCE = 1.0  # [s] of waiting after which a service says what it waits for
JOIN_TIMEOUT = 600.0  # [s] the others get to compile their kernels and to appear
ANSWER_TIMEOUT = 5.0  # [s] a participant gets to tell its set-up
CONFIRMED = 60.0  # [s] the others get to confirm a last message; a launcher, which knows who starves, is stricter
INTERRUPTED = 1.0  # [s] the same where this process was asked to end
FOREIGN = 2.0  # [s] a program of somebody else's gets to leave after the end
REPEAT = 0.2  # [s] between two last messages, for those who joined after the first, or whose link was cut
BRIEF = 0.02  # [s]
ORPHANED = 10.0  # [s] a process gets to its end whose launcher is gone
FOUND_OUT = 3.0  # [s] for everybody to find a difference

T = TypeVar("T")


class Stopped(Exception):
    """The process was asked to end."""


class Participant:
    """A participant of a run: its bus, its set-up, and whether it was asked to stop."""

    def __init__(
        self,
        name: str,
        setup: RunConfig,
        bus: ZenohBus,
        participants: PublisherIds,
        others: list[str],
        speed: float | None = None,
        core: int | None = None,
        compares: Sequence[str] = (),
        realtime: bool = False,
    ):
        """A participant that is about to join.

        Args:
            name: its name among the participants.
            setup: what is flown.
            bus: the session.
            participants: of the run.
            others: participants without which the run cannot begin.
            speed: simulated seconds per second, None for as fast as it goes.
            core: the core that all services of a sequential lock step share, None to leave it to the system.
            compares: those of the others who may have another set-up, which is to be found out at joining.
            realtime: whether it is to run in the scheduler's real-time class.
        """
        self.compares, self.realtime = compares, realtime
        self.name, self.setup, self.bus = name, setup, bus
        self.participants, self.key_prefix = participants, participants.key_prefix
        self.others, self.speed, self.core = others, speed, core
        self.stopping = False
        self.terminated = False  # by SIGTERM, which does not come from the launcher
        self.orphaned = False  # the launcher is gone
        self.abandoned = ""  # who watched the run, and is gone
        self.create_service: Callable[[str], Service]  # by name, for its topics
        self._compiling = False
        self._refused = 0
        self._there = set(others) - {name}  # participants that have joined, or must, and have not left
        self._confirmed: dict[str, set[str]] = {}  # participants by the key of the token that they have declared
        self._changed = threading.Event()  # in one of the two
        self._last_words: list[tuple[str, str]] = []
        on_compile(self._tell_of_compiling)
        signal.signal(END_SIGNAL, self._stop)
        signal.signal(signal.SIGTERM, self._terminate)
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # the launcher answers Ctrl-C for everybody

    @property
    def bundles_ahead(self) -> bool:
        """Whether a service that runs ahead hands over several ticks at once
        (`lapwing.cosim.transport.packet_schedule`); a program of somebody
        else's takes one at a time, as do those of several hosts."""
        return not (self.participants.external or self.compares)

    def _stop(self, *_: object) -> None:
        self.stopping = True

    def _terminate(self, *_: object) -> None:
        self.stopping = self.terminated = True

    def _tell_of_compiling(self, _: str) -> None:
        if not self._compiling:
            self._compiling = True
            self.say(COMPILING_KEY)

    def say(self, key: str, text: str = "") -> None:
        """Tell those who watch the run, on a key of the lock step."""
        self.bus.publisher(f"{self.key_prefix}/{key}/{self.name}")(text.encode(), 0)

    def say_last(self, key: str, text: str = "") -> None:
        """The same at the end of this process; repeated until everybody has confirmed it (`leave`)."""
        self._last_words.append((key, text))
        self.say(key, text)

    def tell_of_refused(self) -> None:
        """Say how many messages of strangers were refused, when there are more than before."""
        if self.bus.refused > self._refused:
            self._refused = self.bus.refused
            self.say(REFUSED_KEY, str(self._refused))

    def end_with_parent(self, endpoint: str) -> None:
        """Stop when the launcher, which holds the other end of standard input, is gone.

        A process that goes on, as one that compiles does, is ended after a while; the folder of its private `endpoint`
        goes with it.
        """

        def watch() -> None:
            while os.read(0, 1):
                pass
            self.orphaned = self.stopping = True
            time.sleep(ORPHANED)
            remove(endpoint)
            os._exit(1)

        threading.Thread(target=watch, daemon=True).start()

    def end_with(self, name: str) -> None:
        """Stop when another participant, who watches the run, is gone."""

        def changed(_: str, alive: bool) -> None:
            if not (alive or self.stopping):
                self.abandoned, self.stopping = name, True

        self.bus.watch_alive(f"{self.key_prefix}/{ALIVE_KEY}/{name}", changed)

    def confirm(self) -> None:
        """Declare that this process has received the last message of everybody whose messages it takes.

        The token stays as long as the session, so that a process whose link was cut sees it later.
        """
        self.bus.declare_alive(f"{self.key_prefix}/{HEARD_KEY}/{self.name}")

    def leave(self, repeat: Callable[[], None], key: str = HEARD_KEY, only: Collection[str] | None = None) -> None:
        """Wait until the others have confirmed the last message of this process, or have left.

        Zenoh does not deliver what is still queued when a session closes, so no process closes its session before.

        Args:
            repeat: publishes the last message again; called until all have confirmed it.
            key: of the token that confirms it.
            only: participants that confirm it, None for all.

        Raises:
            LockStepError: names who did not confirm it in time.
        """
        began = repeated = time.monotonic()
        while late := self._unconfirmed(key, only, time.monotonic() - began):
            now = time.monotonic()
            if now - began > (INTERRUPTED if self.stopping else CONFIRMED):
                if self.stopping:
                    return
                raise LockStepError(f"{self.name}: {', '.join(late)} did not confirm its last message")
            if now - repeated > REPEAT:
                for word in self._last_words:
                    self.say(*word)
                repeat()
                repeated = now
            self._changed.wait(BRIEF)
            self._changed.clear()

    def _unconfirmed(self, key: str, only: Collection[str] | None, waited: float) -> list[str]:
        """Who is there and has not confirmed; a program of somebody else's does so by leaving, for which it has less
        time."""
        late = self._there.copy() - self._confirmed.get(key, set())
        if only is not None:
            late &= set(only)
        if waited > FOREIGN:
            late -= set(self.participants.external)
        return sorted(late)

    def _follow_others(self) -> None:
        """Keep track of who is there, and of who has confirmed what."""

        def there(key: str, alive: bool) -> None:
            name = key.rpartition("/")[2]
            if not alive:
                self._there.discard(name)
            elif name != self.name:
                self._there.add(name)
            self._changed.set()

        def confirmed(key: str, alive: bool) -> None:
            head, name = key.split("/")[-2:]
            if alive:
                self._confirmed.setdefault(head, set()).add(name)
            self._changed.set()

        self.bus.watch_alive(f"{self.key_prefix}/{ALIVE_KEY}/*", there)
        for key in (HEARD_KEY, LOGGED_KEY):
            self.bus.watch_alive(f"{self.key_prefix}/{key}/*", confirmed)

    def key(self, topic: Topic) -> str:
        """The Zenoh key of a topic in this run."""
        return topic.zenoh_key(self.setup.vehicle, self.key_prefix)

    def join(self, meanwhile: Callable[[], None] = lambda: None) -> None:
        """Say that everything is subscribed, wait until everybody else has said so, and compare set-ups.

        Args:
            meanwhile: called again and again while it waits.

        Raises:
            Stopped: asked to end meanwhile.
            LockStepError: somebody did not come.
            ValueError: another participant has resolved something else; names the first difference.
        """
        self._follow_others()
        packed = pack(self.setup)
        self.bus.answer(f"{self.key_prefix}/{SETUP_KEY}/{self.name}", packed)
        self.bus.declare_alive(f"{self.key_prefix}/{ALIVE_KEY}/{self.name}")
        self._await([other for other in self.others if other != self.name], meanwhile)
        limit_silence(LEASE_MS)
        if self.compares:
            self._compare()

    def _await(self, names: list[str], meanwhile: Callable[[], None]) -> None:
        wanted = [f"{self.key_prefix}/{ALIVE_KEY}/{other}" for other in names]

        def stop() -> bool:
            meanwhile()
            return self.stopping

        missing = self.bus.wait_alive(wanted, timeout=JOIN_TIMEOUT, stop=stop)
        if self.stopping:
            raise Stopped
        if missing:
            absent = ", ".join(key.rsplit("/", 1)[1] for key in missing)
            raise LockStepError(f"{self.name}: nobody answers as {absent}")

    def _compare(self) -> None:
        """Refuse to fly with those who have resolved another scene."""
        own = to_json(self.setup)
        for other in self.compares:
            if other == self.name:
                continue
            given = self.bus.ask(f"{self.key_prefix}/{SETUP_KEY}/{other}", ANSWER_TIMEOUT)
            try:
                if given is None or (text := unpack(given)) == own:
                    continue
                found = first_difference(self.setup, from_json(text, self.setup.modules))
            except ValueError as error:
                raise ValueError(f"{self.name}: what {other} flies cannot be read: {error}") from None
            key, here, there = found or ("set-up", "?", "?")
            if self.name in self.compares:
                time.sleep(FOUND_OUT)  # this participant must still answer those who compare later
            raise ValueError(f"{key} is {here!r} here, {there!r} for {other}: resolve the same scene")

    def patient(self, get: Callable[[float], T | None], waiting_for: Callable[[], str]) -> T:
        """What `get(timeout)` gives; says on the bus what is waited for when that takes long.

        Raises:
            Stopped: asked to end.
        """
        waited = 0.0
        while not self.stopping:
            found = get(POLL)
            if found is not None:
                return found
            waited += POLL
            if waited >= PATIENCE:
                self.say(WAITING_KEY, waiting_for())
                self.tell_of_refused()
                waited = 0.0
        raise Stopped
