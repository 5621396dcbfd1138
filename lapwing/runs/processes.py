"""A run with every service in a process of its own."""

import os
from collections.abc import Iterable
from pathlib import Path
from typing import IO

from cosim.interrupt import Stop
from cosim.key_prefix import reserve
from cosim.launcher import launch
from cosim.setup import Setup
from cosim.watch import Watch
from lapwing.runs.compiling import Stopwatch
from lapwing.runs.observer import Elapsed, Observer
from messages.topics import POSE, STATUS
from services import processes
from services.participant import Participation, hand_over


def fly_processes(given: Participation, observer: Observer, beside: Iterable[str] = ()) -> Elapsed:
    """Fly with every service in a process of its own.

    Args:
        given: what every process is given, but for its name and the endpoints.
        observer: is told how far the run is, and at the end what the processes beside had to say.
        beside: processes without which the flight goes on.

    Raises:
        RunFailed: a service died or froze.
        KeyPrefixInUse: another run uses this key prefix.
        ValueError: a service refused what it was given.
        Interrupted: ended by a signal.
    """
    setup = given.setup
    clock = Clock(observer, setup)
    external = given.external or {}
    names = [*processes.needed(setup, external), *([processes.ROUTER] if given.open else [])]
    core = shared_core(setup)

    def give(name: str, endpoints: dict[str, str], stream: IO[bytes]) -> None:
        own = given._replace(
            name=name,
            peers=endpoints,
            core=core if name in setup.services else None,
            open=given.open if name == processes.ROUTER else (),
            with_parent=True,
        )
        hand_over(own, stream)

    with reserve(given.key_prefix), Stop() as stop:
        ended = lambda watch: clock.observe(watch) or stop.number is not None  # noqa: E731
        for name, words in launch(names, give, given.key_prefix, ended, beside, external).items():
            for line in words.splitlines():
                observer.say(f"{name}: {line}")
        stop.check()
    return clock.elapsed


class Clock:
    """Follows a run for the observer, and measures it from its first batch to its last."""

    def __init__(self, observer: Observer, setup: Setup):
        self._observer, self._began = observer, False
        self._compiling = Stopwatch("processes", setup.services, observer.compiling)
        self.elapsed = Elapsed(0.0, 0.0)

    def observe(self, watch: Watch) -> bool:
        """Show what is new; never asks to stop."""
        if watch.began is None:
            if watch.compiling:
                self._compiling.began()
            return False
        if not self._began:
            self._began = True
            self._compiling.ended()
            self._observer.begin()
        self.elapsed = Elapsed(watch.time_ns * 1e-9, watch.wall)
        self._observer.show(watch.time_ns, watch.newest.get(POSE), watch.newest.get(STATUS))
        return False


def shared_core(setup: Setup) -> int | None:
    """The core for all services of a sequential lock step, in which only one works at a time; None: leave it free."""
    if setup.coupling != "sequential" or not hasattr(os, "sched_getaffinity"):
        return None
    cores = sorted(os.sched_getaffinity(0))
    return cores[os.getpid() % len(cores)]


def recorder_log(path: Path) -> str:
    """A log's path for another process, whose working directory may be another."""
    return str(path.absolute())
