"""The lock step of a process: wait for what is due, step, publish."""

import os
import time

from cosim.graph import NEVER, Graph, Service
from cosim.keys import DIVERGED_KEY
from cosim.process import Process, Stopped
from cosim.schedule import DivergedError, Port
from cosim.transfer import PAGE, EndOfRun, Outlets, Source, sources


def run_lockstep(process: Process, service: Service, owns_time: bool) -> None:
    """Step `service` from tick 0 to the last tick of the run.

    Args:
        process: the participant.
        service: what it steps.
        owns_time: whether it keeps the pace, and says which tick is the last.

    The end travels along the bundles: an empty one says that there will be no other.

    Raises:
        Stopped: asked to end.
        LockStepError: a message did not come, not the one that was due, or a state is not sound.
    """
    setup = process.setup
    graph = Graph(setup, [service], 2 * PAGE)
    givers = sources(process, graph)
    outlets = Outlets(process, service, graph)
    process.join()
    outlets.look()
    if process.core is not None:
        pin(process.core)
    started = time.perf_counter()
    try:
        while not process.stopping:
            tick = graph.tick
            for giver in givers:
                giver.take(tick)
            if owns_time and process.speed is not None:
                _pace(started + tick * setup.interval / process.speed)
            graph.advance(tick + 1)
            outlets.publish(tick)
            if graph.ended:
                return
    except EndOfRun:
        return
    except DivergedError as error:  # said before the end is
        process.bus.publisher(f"{process.key_prefix}/{DIVERGED_KEY}/{process.name}")(str(error).encode(), 0)
        raise
    finally:
        outlets.end(graph.tick)
    raise Stopped


class _Rows:
    """Stands for the parts of a service elsewhere: its ports, whose rows come on the bus."""

    def __init__(self, service: str, ports: tuple[Port, ...]):
        self.name, self.outputs = service, ports

    def bind(self, graph: Graph) -> None:
        """Nothing to be known."""

    def act(self, tick: int) -> int:
        """The rows have come."""
        return NEVER


def run_encoder(process: Process, service: Service) -> None:
    """Make the messages of a service that is somebody else's program, and gives rows only.

    Args:
        process: the participant.
        service: its wires are used, its parts are not.

    Raises:
        Stopped: asked to end.
        LockStepError: a bundle did not come, or not the one that was due.
    """
    ports = process.setup.services[service.name].ports
    elsewhere = Service(service.name, [_Rows(service.name, ports)], service.wires)
    graph = Graph(process.setup, [elsewhere], 2 * PAGE)
    giver = Source(process, service.name, [(port.name, port.period, 0) for port in ports], graph)
    outlets = Outlets(process, elsewhere, graph, hands_over=False)
    process.join()
    outlets.look()
    try:
        while not process.stopping:
            tick = graph.tick
            giver.take(tick)
            graph.advance(tick + 1)
            outlets.publish(tick)
    except EndOfRun:
        return
    finally:
        outlets.end(graph.tick)
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
