"""Run with every service in a separate process."""

import time
from collections.abc import Callable, Collection, Iterable
from contextlib import nullcontext
from typing import IO

from lapwing.cosim.access.publisher_ids import PublisherIds, new_secret
from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.diagram.multi_vehicle import primary_topic
from lapwing.cosim.processes.child_process import Child
from lapwing.cosim.processes.interrupt import Interrupted, Stop
from lapwing.cosim.processes.launcher import launch
from lapwing.cosim.processes.run_monitor import RunMonitor
from lapwing.cosim.processes.shared_core import CoreClaim, claim_any
from lapwing.cosim.run_errors import RunFailed
from lapwing.cosim.transport.bus_keys import check_key_prefix
from lapwing.messages.topics import POSE, STATUS
from lapwing.runs.observer import Compilation, Elapsed, Observer
from lapwing.services import process_table
from lapwing.services.process_main import ProcessSpec, write_spec

SLOW, GAIN = 5.0, 2.0  # [s] wall time, and its ratio to the time in one process, above which that mode is advised
NOTICE = 5.0  # [s] after which participants and programs from elsewhere are named that have not joined or answered


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
    config, spec = spec.config, spec._replace(secret=new_secret())
    external, links = spec.external or {}, [*auxiliary]
    clock = Clock(observer, config, external)
    names = [*process_table.required_processes(config, external), *([process_table.ROUTER] if spec.open else [])]
    claim = core_of_services(config)

    def send_spec(name: str, endpoints: dict[str, str], stream: IO[bytes]) -> None:
        own_spec = spec._replace(
            name=name,
            peers=endpoints,
            core=claim.core if claim and name in config.services else None,
            open=spec.open if name == process_table.ROUTER else (),
            with_parent=True,
        )
        write_spec(own_spec, stream)

    participants = PublisherIds(spec.key_prefix, spec.secret, tuple(external))
    with Stop() as stop, claim or nullcontext():

        def observe(watch: RunMonitor) -> bool:
            live(watch)
            return clock.observe(watch) or stop.number is not None

        try:
            outputs = launch(names, send_spec, participants, observe, links, external, early or {}, config.services)
        except RunFailed as error:
            if stop.number is not None:
                raise Interrupted(stop.number, str(error)) from None
            raise
        for name, output in outputs.items():
            for line in output.splitlines():
                observer.say(f"{name}: {line}")
        stop.check()
    needs_processes = links or external or spec.open or spec.realtime
    if spec.speed is None and not needs_processes and (hint := clock.faster_mode(config.services)):
        observer.say(hint)
    if clock.rejected:
        observer.say(f"rejected: {clock.rejected} messages from outside the run")
    return clock.elapsed


class Clock:
    """Progress of a run for its observer, measured from the first to the last log packet.

    Args:
        observer: shows the progress.
        config: run configuration.
        elsewhere: names of participants that somebody else starts.
    """

    def __init__(self, observer: Observer, config: RunConfig, elsewhere: Iterable[str] = ()):
        self._elsewhere, self._created = set(elsewhere), time.monotonic()
        self._observer, self._started, self._waiting, self._slow_disk = observer, False, False, False
        self._pose, self._status = primary_topic(config, POSE), primary_topic(config, STATUS)
        self._progress = -1, 0.0  # newest simulated time [ns], and when it was reached [s]
        self._compilation: Compilation | None = Compilation.of(config)  # None after it was shown
        self.elapsed, self.rejected = Elapsed(0.0, 0.0), 0
        self._block_times: dict[str, float] = {}

    def observe(self, watch: RunMonitor) -> bool:
        """Show the progress. Return False, so that the run continues."""
        self.rejected, self._block_times = watch.rejected, watch.block_times
        if watch.start is None:
            if watch.compiling and self._compilation:
                self._observer.compiling(self._compilation)
                self._compilation = None
            absent = self._elsewhere - watch.present
            if absent and time.monotonic() - self._created > NOTICE:
                self._observer.say(f"waiting for {', '.join(sorted(absent))} to join")
                self._elsewhere = set()
            if watch.outside and not self._waiting:
                self._waiting = True
                self._observer.say(f"waiting for {watch.outside}")
            return False
        if not self._started:
            self._started = True
            self._observer.begin()
        if watch.slow_disk and not self._slow_disk:
            self._slow_disk = True
            self._observer.say("the disk is slow: the run waits until its log is written")
        self._name_outside(watch)
        self.elapsed = Elapsed(watch.time_ns * 1e-9, watch.wall)
        self._observer.show(watch.time_ns, watch.newest.get(self._pose), watch.newest.get(self._status))
        return False

    def _name_outside(self, watch: RunMonitor) -> None:
        """Say once for which program a service waits while the simulated time does not advance."""
        if watch.time_ns != self._progress[0]:
            self._progress, self._waiting = (watch.time_ns, time.monotonic()), False
        elif watch.outside and not self._waiting and time.monotonic() - self._progress[1] > NOTICE:
            self._waiting = True
            self._observer.say(f"waiting for {watch.outside}")

    def faster_mode(self, services: Collection[str]) -> str:
        """Return the advice for the next run after a flight that was slow because its processes exchange data.

        The estimate is the processor time of all blocks, which one process steps in turn; "" if it gains little.
        """
        seconds, wall = sum(self._block_times.values()), self.elapsed.wall
        if self._block_times.keys() < set(services) or wall < SLOW or wall < GAIN * seconds:
            return ""
        return f"--mode single-process: the same bits in about {max(seconds, 0.1):.1f} s instead of {wall:.1f} s"


def core_of_services(config: RunConfig) -> CoreClaim | None:
    """Claim a core for all services with Gauss-Seidel coupling, which work one at a time; None for any core."""
    return claim_any() if config.coupling == "gauss_seidel" else None
