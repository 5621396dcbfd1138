"""Run with all services in this process."""

import time
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

from lapwing.cosim.config.provenance import ENDED, attachments, failure, metadata
from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.diagram.block_diagram import BlockDiagram
from lapwing.cosim.diagram.compiled_loop import running_block
from lapwing.cosim.diagram.multi_vehicle import primary_topic
from lapwing.cosim.executors.single_process import KEPT_TICKS, run_single
from lapwing.cosim.log import LogWriter
from lapwing.cosim.log.log_sequencer import Recording
from lapwing.cosim.processes.interrupt import Interrupted, Stop
from lapwing.cosim.processes.watchdog import Watchdog
from lapwing.cosim.run_errors import DivergedError, LockStepError
from lapwing.messages.topics import POSE, STATUS
from lapwing.runs.observer import Elapsed, Observer, Silent, notify_on_compile
from lapwing.services.process_table import Operator, create_all


def fly_single(
    config: RunConfig,
    log: Path,
    sources: Mapping[str, str] | None = None,
    speed: float | None = None,
    observer: Observer | None = None,
    operator: Operator | Mapping[str, Operator] | None = None,
    last: int | None = None,
    recorded: Mapping[str, Any] = MappingProxyType({}),
) -> Elapsed:
    """Fly with all services in this process, to the end or until a state is invalid, which the log records.

    Args:
        config: run configuration.
        log: path of the log.
        sources: files of the scene, for the log.
        speed: simulated seconds per second, None for as fast as possible.
        observer: shows the progress.
        operator: returns the commands received until a tick; for several vehicles one function for each, by name.
        last: last tick, None for the end of the run.
        recorded: messages of foreign firmwares to resimulate, by vehicle name (`process_table.create`).

    Raises:
        LockStepError: a user's controller or estimator failed.
        ValueError: the log cannot be written.
        Interrupted: ended by a signal.
    """
    watcher = observer or Silent()
    with Watchdog(), notify_on_compile(config, watcher.compiling):
        diagram = BlockDiagram(config, create_all(config, operator, recorded), KEPT_TICKS)
    about = metadata(config, "single-process")
    with Stop(running_block) as stop, Watchdog(), LogWriter(log, about, attachments(config, sources or {})) as writer:
        recording = Recording(writer, config)
        pose, status = primary_topic(config, POSE), primary_topic(config, STATUS)

        def observe(diagram: BlockDiagram) -> bool:
            newest = recording.newest
            watcher.show((diagram.tick - 1) * config.interval_ns, newest.get(pose), newest.get(status))
            return stop.number is not None

        def waits(_: str) -> None:
            stop.check()

        try:
            diagram.open(waits, log)
            watcher.begin()
            started = time.perf_counter()
            run_single(diagram, recording, speed, observe, last)
        except LockStepError as error:
            writer.metadata |= failure(str(error), isinstance(error, DivergedError))
            if not isinstance(error, DivergedError):
                raise
        except Interrupted:
            writer.metadata |= failure(f"{ENDED}; {stop.detail}" if stop.detail else ENDED)
            raise
        finally:
            writer.metadata |= diagram.reports
            diagram.close()
        wall = time.perf_counter() - started
        if stop.number is not None:
            writer.metadata |= failure(ENDED)
        stop.check()
    return Elapsed((diagram.tick - 1) * config.interval, wall)
