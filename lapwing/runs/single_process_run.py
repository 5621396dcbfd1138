"""A run with all services in this process."""

import time
from collections.abc import Mapping
from pathlib import Path

from lapwing.cosim.config.provenance import attachments, failure, metadata
from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.diagram.block_diagram import BlockDiagram
from lapwing.cosim.diagram.multi_vehicle import leading
from lapwing.cosim.executors.single_process import PAGE, run_single
from lapwing.cosim.log import LogWriter
from lapwing.cosim.log.log_sequencer import Recording
from lapwing.cosim.processes.interrupt import Interrupted, Stop
from lapwing.cosim.run_errors import DivergedError, LockStepError
from lapwing.messages.topics import POSE, STATUS
from lapwing.runs.compile_notice import notify_on_compile
from lapwing.runs.observer import Elapsed, Observer, Silent
from lapwing.services.process_table import Operator, create_all


def fly_single(
    setup: RunConfig,
    log: Path,
    sources: Mapping[str, str] | None = None,
    speed: float | None = None,
    observer: Observer | None = None,
    operator: Operator | Mapping[str, Operator] | None = None,
    last: int | None = None,
) -> Elapsed:
    """Fly with all services in this process, to the end or until a state is not sound; the log then says so.

    Args:
        setup: what to fly.
        log: where to record it.
        sources: the files that were resolved, for the log.
        speed: simulated seconds per second, None for as fast as it goes.
        observer: is notify_on_compile how far the run is.
        operator: gives the commands that have come until a tick; for several vehicles one for each, by name.
        last: the tick after which to stop, None for the end of the run.

    Raises:
        LockStepError: an own controller or estimator failed.
        ValueError: the log cannot be written.
        Interrupted: ended by a signal.
    """
    watcher = observer or Silent()
    with notify_on_compile(setup, watcher.compiling):
        graph = BlockDiagram(setup, create_all(setup, operator), PAGE)
    with Stop() as stop, LogWriter(log, metadata(setup, "single-process"), attachments(setup, sources or {})) as writer:
        recording = Recording(writer, setup)
        pose, status = leading(setup, POSE), leading(setup, STATUS)

        def observe(graph: BlockDiagram) -> bool:
            newest = recording.newest
            watcher.show((graph.tick - 1) * setup.interval_ns, newest.get(pose), newest.get(status))
            return stop.number is not None

        watcher.begin()
        started = time.perf_counter()
        try:
            run_single(graph, recording, speed, observe, last)
        except LockStepError as error:
            writer.metadata |= failure(str(error), isinstance(error, DivergedError))
            if not isinstance(error, DivergedError):
                raise
        wall = time.perf_counter() - started
        if stop.number is not None:
            writer.metadata |= failure(str(Interrupted(stop.number)))
        stop.check()
    return Elapsed((graph.tick - 1) * setup.interval, wall)
