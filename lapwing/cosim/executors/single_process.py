"""All services in this process: the graph of the whole scene, advanced by pages of ticks, logged a page at a time."""

import time
from collections.abc import Callable

from lapwing.cosim.diagram.block_diagram import BlockDiagram
from lapwing.cosim.log.log_sequencer import Recording

PAGE = 1000  # ticks
PACED = 0.05  # [s] of wall time in a page of a run that keeps a speed
LOOK = 0.2  # [s] of wall time between two looks at the run


def run_single(
    graph: BlockDiagram,
    recording: Recording | None,
    speed: float | None = None,
    observe: Callable[[BlockDiagram], bool] = lambda graph: False,
    last: int | None = None,
) -> None:
    """Fly a scene to its end.

    Args:
        graph: all services of the run, at its beginning, on rows that keep a `PAGE`.
        recording: receives the messages; None without a log.
        speed: simulated seconds per second, None for as fast as it goes.
        observe: called now and then; says whether to stop.
        last: the tick after which to stop, None for the end of the run.

    Raises:
        LockStepError: a state is invalid; all earlier ticks are recorded.
    """
    setup = graph.setup
    page = PAGE if speed is None else max(1, min(PAGE, round(PACED * speed / setup.interval)))
    end = setup.last_tick + 1 if last is None else last + 1
    started = next_look = time.perf_counter()
    recorded = 0
    try:
        while not graph.ended and graph.tick < end:
            if speed is not None:
                time.sleep(max(0.0, started + graph.tick * setup.interval / speed - time.perf_counter()))
            graph.advance(min(graph.tick + page, end))
            if recording:
                recording.write(graph.record_batches(recorded, graph.tick), graph.tick - 1)
            recorded = graph.tick
            if time.perf_counter() >= next_look:
                next_look += LOOK
                if observe(graph):
                    return
        observe(graph)
    finally:
        if recording:
            recording.write(graph.record_batches(recorded, graph.tick), graph.tick - 1)
            recording.finish()
