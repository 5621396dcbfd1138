"""Single-process executor: steps all services of a scene in blocks of ticks, and logs each block."""

import time
from collections.abc import Callable

from lapwing.cosim.diagram.block_diagram import BlockDiagram
from lapwing.cosim.log.log_sequencer import Recording

KEPT_TICKS = 1000  # ticks
PACED = 0.05  # [s] of wall time in a block of a run with a real-time factor
OBSERVE_PERIOD = 0.2  # [s] of wall time between two calls of `observe`


def run_single(
    diagram: BlockDiagram,
    recording: Recording | None,
    speed: float | None = None,
    observe: Callable[[BlockDiagram], bool] = lambda diagram: False,
    last: int | None = None,
) -> None:
    """Run a scene to its end.

    Args:
        diagram: all services of the run, at tick 0, with rows for `KEPT_TICKS` ticks.
        recording: receives the messages; None without a log.
        speed: simulated seconds per second; None for as fast as possible.
        observe: called every `OBSERVE_PERIOD`; the run stops when it returns True.
        last: last tick; None for the end of the run.

    Raises:
        LockStepError: a state is invalid; all earlier ticks are recorded.
    """
    config = diagram.config
    kept_ticks = KEPT_TICKS if speed is None else max(1, min(KEPT_TICKS, round(PACED * speed / config.interval)))
    end = config.last_tick + 1 if last is None else last + 1
    started = next_observation = time.perf_counter()
    recorded = 0
    try:
        while not diagram.ended and diagram.tick < end:
            if speed is not None:
                time.sleep(max(0.0, started + diagram.tick * config.interval / speed - time.perf_counter()))
            diagram.advance(min(diagram.tick + kept_ticks, end))
            if recording:
                recording.write(diagram.record_batches(recorded, diagram.tick), diagram.tick - 1)
            recorded = diagram.tick
            if time.perf_counter() >= next_observation:
                next_observation += OBSERVE_PERIOD
                if observe(diagram):
                    return
        observe(diagram)
    finally:
        if recording:
            recording.write(diagram.record_batches(recorded, diagram.tick), diagram.tick - 1)
            recording.finish()
