"""The lock step of a process: wait for what is due, step, publish."""

import json
import os
import time
from contextlib import suppress

from lapwing.cosim.diagram.block_diagram import NEVER, BlockDiagram, Service
from lapwing.cosim.diagram.tick_schedule import Port
from lapwing.cosim.executors import realtime
from lapwing.cosim.executors.deadlines import Deadlines
from lapwing.cosim.executors.log_backpressure import LogBackpressure
from lapwing.cosim.executors.participant import Participant, Stopped
from lapwing.cosim.run_errors import CutShortError, DivergedError
from lapwing.cosim.transport.bus_keys import DEADLINES_KEY, DIVERGED_KEY, ENDED_KEY, REPORTS_KEY
from lapwing.cosim.transport.packet_exchange import PAGE, EndOfRun, PacketReceiver, PacketSender, packet_receivers
from lapwing.cosim.transport.packet_schedule import ticks_per_packet


def run_lockstep(process: Participant, service: Service, owns_time: bool, recorder: str) -> None:
    """Step `service` from tick 0 to the last tick of the run.

    Args:
        process: the participant.
        service: what it steps.
        owns_time: whether it keeps the pace, and says which tick is the last.
        recorder: the participant for whose log the clock owner waits.

    The end travels with the step packets: an empty one is the last. The clock owner publishes in addition
    whether that was the end of the run.

    Raises:
        Stopped: this process was requested to end.
        LockStepError: a message is missing or out of order, a state is invalid, or another participant ended early.
    """
    setup = process.setup
    graph = BlockDiagram(setup, [service], 2 * PAGE)
    graph.advance(0)  # nothing is stepped, but the loop over the parts is compiled before the clock begins
    givers = packet_receivers(process, graph)
    outlets = PacketSender(process, service, graph)
    backlog = LogBackpressure(process, recorder) if owns_time else None

    def waits(text: str) -> None:
        if process.stopping:
            raise Stopped
        process.waits_outside(text)

    try:
        graph.open(waits)
        _run(process, graph, givers, outlets, owns_time, backlog)
    finally:
        graph.close()


def _run(
    process: Participant,
    graph: BlockDiagram,
    givers: list[PacketReceiver],
    outlets: PacketSender,
    owns_time: bool,
    backlog: LogBackpressure | None,
) -> None:
    """Join the others, and step from tick 0 to the last tick of the run."""
    setup = process.setup
    process.join()
    outlets.refresh_subscribers()
    if process.core is not None:
        pin(process.core)
        if process.speed is None:
            batch()
    if process.realtime:
        realtime.enter()
    allowed = setup.interval / process.speed if process.speed is not None else None
    at_once = ticks_per_packet(setup, process.name) if process.packs_ticks else 1
    deadlines = Deadlines()
    started = time.perf_counter()
    try:
        while not graph.ended:
            if process.stopping:
                raise Stopped
            tick = graph.tick
            known = min([giver.receive(tick) for giver in givers], default=tick + 1)
            if backlog:
                backlog.wait_for_log(tick)
            if allowed is not None and owns_time:
                deadlines.note(_pace(started + tick * allowed))
            begun = time.perf_counter()
            graph.advance(min(known, tick + at_once))
            outlets.publish(tick, graph.tick)
            if allowed is not None and not owns_time:
                deadlines.note(time.perf_counter() - begun - allowed * (graph.tick - tick))
        if owns_time:
            process.publish_final_status(ENDED_KEY)
    except EndOfRun as end:
        if owns_time:
            process.publish_final_status(ENDED_KEY, message := f"{end} ended before the run did")
            raise CutShortError(message) from None
    except Stopped:
        if process.terminated:
            process.publish_final_status(ENDED_KEY, f"{process.name} was ended by SIGTERM")
        raise
    except DivergedError as error:  # said before the end is
        process.publish_final_status(DIVERGED_KEY, str(error))
        raise
    finally:
        if allowed is not None:
            process.publish_final_status(DEADLINES_KEY, deadlines.to_text())
        if reports := graph.reports:
            process.publish_final_status(REPORTS_KEY, json.dumps(reports))
        _leave(process, outlets, graph.tick)


def _leave(process: Participant, outlets: PacketSender, stop: int) -> None:
    """Publish the remaining ticks before `stop`, and wait until all participants have received them."""
    outlets.end(stop)
    process.confirm()
    process.leave(lambda: outlets.publish_end(stop))


class _Rows:
    """Placeholder for the blocks of an external service: its ports, whose rows arrive on the bus."""

    def __init__(self, service: str, ports: tuple[Port, ...]):
        self.name, self.outputs = service, ports

    def bind(self, graph: BlockDiagram) -> None:
        """Nothing to be known."""

    def on_tick(self, tick: int) -> int:
        """Do nothing, because the rows have arrived."""
        return NEVER


def run_encoder(process: Participant, service: Service) -> None:
    """Encode the messages of an external service, which publishes rows only.

    Args:
        process: the participant.
        service: its wires are used, its parts are not.

    Raises:
        Stopped: asked to end.
        LockStepError: a bundle did not come, or not the one that was due.
    """
    ports = process.setup.services[service.name].ports
    elsewhere = Service(service.name, [_Rows(service.name, ports)], service.wires)
    graph = BlockDiagram(process.setup, [elsewhere], 2 * PAGE)
    giver = PacketReceiver(process, service.name, [(port.name, port.period, 0) for port in ports], graph)
    outlets = PacketSender(process, elsewhere, graph, hands_over=False)
    process.join()
    outlets.refresh_subscribers()
    try:
        while not process.stopping:
            tick = graph.tick
            giver.receive(tick)
            graph.advance(tick + 1)
            outlets.publish(tick, tick + 1)
    except EndOfRun:
        return
    finally:
        _leave(process, outlets, graph.tick)
    raise Stopped


def pin(core: int) -> None:
    """Keep all threads of this process on one core.

    In sequential lock step only one process works at a time; handing over on one core costs half of what waking
    another core costs (docs/reference/benchmarks.md).
    """
    if hasattr(os, "sched_setaffinity"):
        for thread in os.listdir("/proc/self/task"):
            os.sched_setaffinity(int(thread), {core})


def batch() -> None:
    """Let the scheduler take this process for batch work, where it is an ordinary one.

    What it wakes then runs when it waits, instead of interrupting it: on a core that all services share that spares a
    third of the switches from one thread to another (docs/reference/benchmarks.md).
    """
    if hasattr(os, "SCHED_BATCH") and os.sched_getscheduler(0) == os.SCHED_OTHER:
        for thread in os.listdir("/proc/self/task"):
            with suppress(OSError):  # it has ended meanwhile, or a sandbox knows no classes
                os.sched_setscheduler(int(thread), os.SCHED_BATCH, os.sched_param(0))


def _pace(when: float) -> float:
    """Sleep until `when` on the performance counter; says by how much [s] that has passed, negative where it has not.

    A run that is late hurries until it is on time again.
    """
    left = when - time.perf_counter()
    if left > 0:
        time.sleep(left)
    return -left
