"""Run with every service in a separate process."""

import os
from collections.abc import Callable, Iterable
from typing import IO

from lapwing.cosim.access.publisher_ids import PublisherIds, new_secret
from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.diagram.multi_vehicle import primary_topic
from lapwing.cosim.processes.child_process import Child
from lapwing.cosim.processes.interrupt import Stop
from lapwing.cosim.processes.launcher import launch
from lapwing.cosim.processes.run_monitor import RunMonitor
from lapwing.cosim.transport.key_prefix import check_key_prefix
from lapwing.messages.topics import POSE, STATUS
from lapwing.runs.compile_notice import Stopwatch
from lapwing.runs.observer import Elapsed, Observer
from lapwing.services import process_table
from lapwing.services.process_main import ProcessSpec, write_spec


def fly_processes(
    given: ProcessSpec,
    observer: Observer,
    beside: Iterable[str] = (),
    live: Callable[[RunMonitor], None] = lambda watch: None,
    early: dict[str, Child] | None = None,
) -> Elapsed:
    """Fly with every service in a separate process.

    Args:
        given: what every process is given, but for its name and the endpoints.
        observer: shows the progress, and at the end the output of the auxiliary processes.
        beside: auxiliary processes, without which the run continues.
        live: called about five times a second with the run monitor.
        early: processes that are already started.

    Raises:
        RunFailed: a service died or froze, or the run ended before its time.
        ValueError: invalid key prefix, or a service rejected its configuration.
        Interrupted: ended by a signal.
    """
    check_key_prefix(given.key_prefix)
    setup, given = given.setup, given._replace(secret=new_secret())
    clock = Clock(observer, setup)
    external = given.external or {}
    names = [*process_table.required_processes(setup, external), *([process_table.ROUTER] if given.open else [])]
    core = shared_core(setup)

    def give(name: str, endpoints: dict[str, str], stream: IO[bytes]) -> None:
        own = given._replace(
            name=name,
            peers=endpoints,
            core=core if name in setup.services else None,
            open=given.open if name == process_table.ROUTER else (),
            with_parent=True,
        )
        write_spec(own, stream)

    participants = PublisherIds(given.key_prefix, given.secret, tuple(external))
    with Stop() as stop:

        def ended(watch: RunMonitor) -> bool:
            live(watch)
            return clock.observe(watch) or stop.number is not None

        said = launch(names, give, participants, ended, beside, external, early, setup.services)
        for name, words in said.items():
            for line in words.splitlines():
                observer.say(f"{name}: {line}")
        stop.check()
    if clock.refused:
        observer.say(f"rejected: {clock.refused} messages from outside the run")
    return clock.elapsed


class Clock:
    """Follows a run for the observer, and measures it from its first batch to its last."""

    def __init__(self, observer: Observer, setup: RunConfig):
        self._observer, self._began, self._slow_disk = observer, False, False
        self._pose, self._status = primary_topic(setup, POSE), primary_topic(setup, STATUS)
        self._compiling = Stopwatch("multi-process", setup, observer.compiling)
        self.elapsed, self.refused = Elapsed(0.0, 0.0), 0

    def observe(self, watch: RunMonitor) -> bool:
        """Show what is new; never asks to stop."""
        self.refused = watch.refused
        if watch.began is None:
            if watch.compiling:
                self._compiling.began()
            return False
        if not self._began:
            self._began = True
            self._compiling.ended()
            self._observer.begin()
        if watch.slow_disk and not self._slow_disk:
            self._slow_disk = True
            self._observer.say("the disk is slow: the run waits for its log to be written")
        self.elapsed = Elapsed(watch.time_ns * 1e-9, watch.wall)
        self._observer.show(watch.time_ns, watch.newest.get(self._pose), watch.newest.get(self._status))
        return False


def shared_core(setup: RunConfig) -> int | None:
    """Return the core for all services of a sequential lock step, which work one at a time; None for any core."""
    if setup.coupling != "gauss_seidel" or not hasattr(os, "sched_getaffinity"):
        return None
    cores = sorted(os.sched_getaffinity(0))
    return cores[os.getpid() % len(cores)]
