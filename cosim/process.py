"""A participant of a run as a process of its own: it joins the others on the bus, and waits with them."""

import os
import signal
import threading
import time
from collections.abc import Callable
from typing import TypeVar

from cosim.bus import ZenohBus
from cosim.keys import ALIVE_KEY, COMPILING_KEY, SETUP_KEY, WAITING_KEY
from cosim.schedule import LockStepError
from cosim.serialise import first_difference, from_json, to_json
from cosim.setup import Setup
from dynamics.kernel import on_compile
from messages.topics import Topic

POLL = 0.1  # [s] between two looks at whether to stop
PATIENCE = 1.0  # [s] of waiting after which a service says what it waits for
JOIN_TIMEOUT = 600.0  # [s] the others get to compile their kernels and to appear
ANSWER_TIMEOUT = 5.0  # [s] a participant gets to tell its set-up
FOUND_OUT = 3.0  # [s] for everybody to find a difference

T = TypeVar("T")


class Stopped(Exception):
    """The process was asked to end."""


class Process:
    """A participant of a run: its bus, its set-up, and whether it was asked to stop."""

    def __init__(
        self,
        name: str,
        setup: Setup,
        bus: ZenohBus,
        key_prefix: str,
        others: list[str],
        speed: float | None = None,
        core: int | None = None,
        compares: bool = False,
    ):
        """A participant that is about to join.

        Args:
            name: its name among the participants.
            setup: what is flown.
            bus: the session.
            key_prefix: key prefix of the run.
            others: participants without which the run cannot begin.
            speed: simulated seconds per second, None for as fast as it goes.
            core: the core that all services of a sequential lock step share, None to leave it to the system.
            compares: whether the others may have another set-up, which is to be found out at joining.
        """
        self.compares = compares
        self.name, self.setup, self.bus, self.key_prefix = name, setup, bus, key_prefix
        self.others, self.speed, self.core = others, speed, core
        self.stopping = False
        self._compiling = False
        on_compile(self._tell_of_compiling)
        signal.signal(signal.SIGTERM, self._stop)
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # the launcher answers Ctrl-C for everybody

    def _stop(self, *_: object) -> None:
        self.stopping = True

    def _tell_of_compiling(self, _: str) -> None:
        if not self._compiling:
            self._compiling = True
            self.bus.publisher(f"{self.key_prefix}/{COMPILING_KEY}/{self.name}")(b"", 0)

    def end_with_parent(self) -> None:
        """Stop when the launcher, which holds the other end of standard input, is gone."""

        def watch() -> None:
            while os.read(0, 1):
                pass
            self.stopping = True

        threading.Thread(target=watch, daemon=True).start()

    def end_with(self, name: str) -> None:
        """Stop when another participant, who watches the run, is gone."""

        def changed(_: str, alive: bool) -> None:
            self.stopping = self.stopping or not alive

        self.bus.watch_alive(f"{self.key_prefix}/{ALIVE_KEY}/{name}", changed)

    def key(self, topic: Topic) -> str:
        """The Zenoh key of a topic in this run."""
        return topic.zenoh_key(self.setup.vehicle, self.key_prefix)

    def join(self) -> None:
        """Say that everything is subscribed, wait until everybody else has said so, and compare set-ups.

        Raises:
            Stopped: asked to end meanwhile.
            LockStepError: somebody did not come.
            ValueError: another participant has resolved something else; names the first difference.
        """
        self.bus.answer(f"{self.key_prefix}/{SETUP_KEY}/{self.name}", to_json(self.setup).encode())
        self.bus.declare_alive(f"{self.key_prefix}/{ALIVE_KEY}/{self.name}")
        wanted = [f"{self.key_prefix}/{ALIVE_KEY}/{other}" for other in self.others if other != self.name]
        missing = self.bus.wait_alive(wanted, timeout=JOIN_TIMEOUT, stop=lambda: self.stopping)
        if self.stopping:
            raise Stopped
        if missing:
            names = ", ".join(key.rsplit("/", 1)[1] for key in missing)
            raise LockStepError(f"{self.name}: nobody answers as {names}")
        if self.compares:
            self._compare()

    def _compare(self) -> None:
        """Refuse to fly with those who have resolved another scene."""
        own = to_json(self.setup)
        for other in self.others:
            if other == self.name:
                continue
            given = self.bus.ask(f"{self.key_prefix}/{SETUP_KEY}/{other}", ANSWER_TIMEOUT)
            if given is None or given.decode() == own:
                continue
            found = first_difference(self.setup, from_json(given.decode()))
            key, here, there = found or ("set-up", "?", "?")
            time.sleep(FOUND_OUT)  # this participant must still answer those who compare later
            raise ValueError(f"{self.name}: {key} is {here!r} here, {there!r} for {other}: resolve the same scene")

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
                self.bus.publisher(f"{self.key_prefix}/{WAITING_KEY}/{self.name}")(waiting_for().encode(), 0)
                waited = 0.0
        raise Stopped
