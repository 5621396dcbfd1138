"""Run with all services in this process."""

import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any

from lapwing.cosim.config.provenance import ENDED, attachments, failure, metadata
from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.diagram.block_diagram import BlockDiagram, Service
from lapwing.cosim.diagram.multi_vehicle import primary_topic
from lapwing.cosim.executors.single_process import PAGE, run_single
from lapwing.cosim.log import LogWriter
from lapwing.cosim.log.log_sequencer import Recording
from lapwing.cosim.processes.interrupt import Stop
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
    recorded: Mapping[str, Any] = MappingProxyType({}),
    services: Sequence[Service] | None = None,
) -> Elapsed:
    """Fly with all services in this process, to the end or until a state is invalid, which the log records.

    Args:
        setup: run configuration.
        log: path of the log.
        sources: files of the scene, for the log.
        speed: simulated seconds per second, None for as fast as possible.
        observer: shows the progress.
        operator: returns the commands received until a tick; for several vehicles one function for each, by name.
        last: last tick, None for the end of the run.
        recorded: messages of foreign firmwares to resimulate, by vehicle name (`process_table.create`).
        services: services of the run, in order; None for those of the process table.

    Raises:
        LockStepError: a user's controller or estimator failed.
        ValueError: the log cannot be written.
        Interrupted: ended by a signal.
    """
    watcher = observer or Silent()
    with notify_on_compile(setup, watcher.compiling):
        graph = BlockDiagram(setup, services or create_all(setup, operator, recorded), PAGE)
    with Stop() as stop, LogWriter(log, metadata(setup, "single-process"), attachments(setup, sources or {})) as writer:
        recording = Recording(writer, setup)
        pose, status = primary_topic(setup, POSE), primary_topic(setup, STATUS)

        def observe(graph: BlockDiagram) -> bool:
            newest = recording.newest
            watcher.show((graph.tick - 1) * setup.interval_ns, newest.get(pose), newest.get(status))
            return stop.number is not None

        def waits(_: str) -> None:
            stop.check()

        try:
            graph.open(waits)
            watcher.begin()
            started = time.perf_counter()
            run_single(graph, recording, speed, observe, last)
        except LockStepError as error:
            writer.metadata |= failure(str(error), isinstance(error, DivergedError))
            if not isinstance(error, DivergedError):
                raise
        finally:
            writer.metadata |= graph.reports
            graph.close()
        wall = time.perf_counter() - started
        if stop.number is not None:
            writer.metadata |= failure(ENDED)
        stop.check()
    return Elapsed((graph.tick - 1) * setup.interval, wall)
