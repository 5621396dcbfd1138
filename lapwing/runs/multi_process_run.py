"""Run with every service in a separate process."""

import time
from collections.abc import Callable, Iterable
from contextlib import nullcontext
from typing import IO

from lapwing.cosim.access.publisher_ids import PublisherIds, new_secret
from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.diagram.multi_vehicle import primary_topic
from lapwing.cosim.processes.child_process import Child
from lapwing.cosim.processes.interrupt import Stop
from lapwing.cosim.processes.launcher import launch
from lapwing.cosim.processes.run_monitor import RunMonitor
from lapwing.cosim.processes.shared_core import CoreClaim, claim_any
from lapwing.cosim.transport.bus_keys import check_key_prefix
from lapwing.messages.topics import POSE, STATUS
from lapwing.runs.compile_notice import Compilation
from lapwing.runs.observer import Elapsed, Observer
from lapwing.services import process_table
from lapwing.services.process_main import ProcessSpec, write_spec

NOTICE = 5.0  # [s] after which participants that are started elsewhere and have not joined are named


def fly_processes(
    spec: ProcessSpec,
    observer: Observer,
    auxiliary: Iterable[str] = (),
    live: Callable[[RunMonitor], None] = lambda watch: None,
    early: dict[str, Child] | None = None,
) -> Elapsed:
    """Fly with every service in a separate process.

    Args:
        spec: specification of the processes, without names and endpoints.
        observer: shows the progress, and at the end the output of the auxiliary processes.
        auxiliary: names of the processes without which the run continues.
        live: called about five times a second with the run monitor.
        early: processes that are already started.

    Raises:
        RunFailed: a service died or stalled, or the run ended early.
        ValueError: invalid key prefix, or a service rejected its configuration.
        Interrupted: ended by a signal.
    """
    check_key_prefix(spec.key_prefix)
    setup, spec = spec.setup, spec._replace(secret=new_secret())
    external = spec.external or {}
    clock = Clock(observer, setup, external)
    names = [*process_table.required_processes(setup, external), *([process_table.ROUTER] if spec.open else [])]
    claim = core_of_services(setup)

    def send_spec(name: str, endpoints: dict[str, str], stream: IO[bytes]) -> None:
        own_spec = spec._replace(
            name=name,
            peers=endpoints,
            core=claim.core if claim and name in setup.services else None,
            open=spec.open if name == process_table.ROUTER else (),
            with_parent=True,
        )
        write_spec(own_spec, stream)

    participants = PublisherIds(spec.key_prefix, spec.secret, tuple(external))
    with Stop() as stop, claim or nullcontext():

        def observe(watch: RunMonitor) -> bool:
            live(watch)
            return clock.observe(watch) or stop.number is not None

        outputs = launch(names, send_spec, participants, observe, [*auxiliary], external, early or {}, setup.services)
        for name, output in outputs.items():
            for line in output.splitlines():
                observer.say(f"{name}: {line}")
        stop.check()
    if clock.rejected:
        observer.say(f"rejected: {clock.rejected} messages from outside the run")
    return clock.elapsed


class Clock:
    """Progress of a run for its observer, measured from the first to the last log packet.

    Args:
        observer: shows the progress.
        setup: run configuration.
        elsewhere: names of participants that somebody else starts.
    """

    def __init__(self, observer: Observer, setup: RunConfig, elsewhere: Iterable[str] = ()):
        self._elsewhere, self._created = set(elsewhere), time.monotonic()
        self._observer, self._started, self._slow_disk = observer, False, False
        self._pose, self._status = primary_topic(setup, POSE), primary_topic(setup, STATUS)
        self._compilation: Compilation | None = Compilation.of(setup)  # None after it was shown
        self.elapsed, self.rejected = Elapsed(0.0, 0.0), 0

    def observe(self, watch: RunMonitor) -> bool:
        """Show the progress. Return False, so that the run continues."""
        self.rejected = watch.rejected
        if watch.start is None:
            if watch.compiling and self._compilation:
                self._observer.compiling(self._compilation)
                self._compilation = None
            absent = self._elsewhere - watch.present
            if absent and time.monotonic() - self._created > NOTICE:
                self._observer.say(f"waiting for {', '.join(sorted(absent))} to join")
                self._elsewhere = set()
            return False
        if not self._started:
            self._started = True
            self._observer.begin()
        if watch.slow_disk and not self._slow_disk:
            self._slow_disk = True
            self._observer.say("the disk is slow: the run waits until its log is written")
        self.elapsed = Elapsed(watch.time_ns * 1e-9, watch.wall)
        self._observer.show(watch.time_ns, watch.newest.get(self._pose), watch.newest.get(self._status))
        return False


def core_of_services(setup: RunConfig) -> CoreClaim | None:
    """Claim a core for all services with Gauss-Seidel coupling, which work one at a time; None for any core."""
    return claim_any() if setup.coupling == "gauss_seidel" else None
