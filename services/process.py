"""The shell around a service that runs as a process of its own: joins the bus, waits, steps, publishes."""

import os
import signal
import threading
import time
from collections.abc import Callable
from typing import Any, TypeVar

from messages.topics import Topic
from services.bus import ZenohBus
from services.journal import Outlets
from services.lockstep import Input, LockStepError, Service, published
from services.outside import OPERATOR_KEY, Operator, commands, joined, nobody
from services.scene import Scene
from services.sections import Exchange, Vehicle, period

POLL = 0.1  # [s] between two looks at whether to stop
PATIENCE = 1.0  # [s] of waiting after which a service says what it waits for
WAITING_KEY, ALIVE_KEY = "_waiting", "_alive"

T = TypeVar("T")


class EndOfRun(Exception):
    """A producer says that there will be no further message."""


class Stopped(Exception):
    """The process was asked to end."""


class Process:
    """A participant of a run: its bus, its scene, and whether it was asked to stop."""

    def __init__(
        self,
        name: str,
        scene: Scene,
        bus: ZenohBus,
        space: str,
        others: list[str],
        speed: float | None = None,
        core: int | None = None,
    ):
        """A participant that is about to join.

        Args:
            name: its name among the participants.
            scene: what is flown.
            bus: the session.
            space: key space of the run.
            others: participants without which the run cannot begin.
            speed: simulated seconds per second, None for as fast as it goes.
            core: the core that all services of a sequential lock step share, None to leave it to the system.
        """
        self.name, self.scene, self.bus, self.space = name, scene, bus, space
        self.others, self.speed, self.core = others, speed, core
        self.stopping = False
        signal.signal(signal.SIGTERM, self._stop)
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # the launcher answers Ctrl-C for everybody

    def _stop(self, *_: object) -> None:
        self.stopping = True

    def end_with_parent(self) -> None:
        """Stop when the launcher, which holds the other end of standard input, is gone."""

        def watch() -> None:
            while os.read(0, 1):
                pass
            self.stopping = True

        threading.Thread(target=watch, daemon=True).start()

    def end_with(self, name: str) -> None:
        """Stop when another participant, who watches the run, is gone."""

        def seen(_: str, alive: bool) -> None:
            self.stopping = self.stopping or not alive

        self.bus.watch_alive(f"{self.space}/{ALIVE_KEY}/{name}", seen)

    def key(self, topic: Topic) -> str:
        """The Zenoh key of a topic in this run."""
        return topic.zenoh_key(self.scene[Vehicle].name, self.space)

    def join(self) -> None:
        """Say that everything is subscribed, and wait until everybody else has said so.

        Raises:
            Stopped: asked to end meanwhile.
            LockStepError: somebody did not come.
        """
        self.bus.declare_alive(f"{self.space}/{ALIVE_KEY}/{self.name}")
        wanted = [f"{self.space}/{ALIVE_KEY}/{other}" for other in self.others if other != self.name]
        missing = self.bus.wait_alive(wanted, timeout=120.0, stop=lambda: self.stopping)
        if self.stopping:
            raise Stopped
        if missing:
            names = ", ".join(key.rsplit("/", 1)[1] for key in missing)
            raise LockStepError(f"{self.name}: nobody answers as {names}")

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
                self.bus.publisher(f"{self.space}/{WAITING_KEY}/{self.name}")(waiting_for().encode(), 0)
                waited = 0.0
        raise Stopped


class _Port:
    """An input of a service: when a message is due on it, and what has arrived."""

    def __init__(self, process: Process, needed: Input):
        self._process = process
        self._topic = needed.topic
        self._decode = needed.topic.message.decode
        self._period = period(process.scene, needed.topic)
        self._delay = needed.delay
        self._interval = process.scene[Exchange].interval_ns
        self._get = process.bus.subscribe(process.key(needed.topic)).get

    def take(self, tick: int) -> Any:
        """The message due at `tick`, None where none is.

        Raises:
            EndOfRun: the producer has ended.
            LockStepError: another message came than the one that is due.
        """
        stamp = tick - self._delay
        if stamp < 0 or stamp % self._period:
            return None
        time_ns, payload = self._get(POLL) or self._process.patient(self._get, lambda: self._describe(stamp))
        if not payload:
            raise EndOfRun
        if time_ns != stamp * self._interval:
            raise LockStepError(f"{self._topic.name}: expected the message of tick {stamp}, got {time_ns} ns")
        return self._decode(payload)

    def _describe(self, stamp: int) -> str:
        return f"{self._topic.name} of tick {stamp}"


class _Outside:
    """An external input: what has come on the bus until its tick, as one message that is published and recorded."""

    def __init__(self, process: Process, needed: Input, outlets: Outlets, operator: Operator):
        self._topic, self._outlets, self._operator = needed.topic, outlets, operator
        self._period = period(process.scene, needed.topic)
        self._interval = process.scene[Exchange].interval_ns
        self._get = process.bus.subscribe(f"{process.space}/{OPERATOR_KEY}").get

    def take(self, tick: int) -> Any:
        """The message of `tick`, None where none is due."""
        if tick % self._period:
            return None
        given = list(self._operator(tick))
        while arrived := self._get(0.0):
            given += commands(arrived[1])
        message = joined(tick * self._interval, given)
        self._outlets.publish(tick, [(self._topic, message)])
        return message


def run_lockstep(process: Process, service: Service, operator: Operator = nobody) -> None:
    """Step `service` from tick 0 to the last tick of the run.

    Args:
        process: the participant.
        service: what it steps.
        operator: who speaks to its external input, besides those on the bus.

    The service that owns time has `finished`, which says after a step that this tick was the last; it also keeps the
    pace. The end travels along the topics: an empty message says that there will be no other.

    Raises:
        Stopped: asked to end.
        LockStepError: a message did not come, or not the one that was due.
    """
    outlets = Outlets(process, published([service]))
    ports = [
        _Outside(process, needed, outlets, operator) if needed.external else _Port(process, needed)
        for needed in service.inputs
    ]
    owns_time = hasattr(service, "finished")
    interval = process.scene[Exchange].interval_ns
    process.join()
    if process.core is not None:
        pin(process.core)
    started = time.perf_counter()
    tick = 0
    try:
        while not process.stopping:
            messages = [port.take(tick) for port in ports]
            if owns_time and process.speed is not None:
                _pace(started + tick * interval * 1e-9 / process.speed)
            outlets.publish(tick, service.step(tick, *messages))
            if owns_time and service.finished:  # type: ignore[attr-defined]
                return
            tick += 1
    except EndOfRun:
        return
    finally:
        outlets.end(tick)
    raise Stopped


def pin(core: int) -> None:
    """Keep all threads of this process on one core.

    In sequential lock step only one process works at a time; handing over on one core costs half of what waking
    another core costs (docs/benchmarks.md).
    """
    if hasattr(os, "sched_setaffinity"):
        for thread in os.listdir("/proc/self/task"):
            os.sched_setaffinity(int(thread), {core})


def _pace(when: float) -> None:
    """Sleep until `when` on the performance counter; a run that is late hurries until it is on time again."""
    left = when - time.perf_counter()
    if left > 0:
        time.sleep(left)
