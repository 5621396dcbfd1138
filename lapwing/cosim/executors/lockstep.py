"""Lock step of a process: wait for the inputs that are due, step, publish."""

import json
import math
import os
import time
from contextlib import suppress
from pathlib import Path

from lapwing.cosim.diagram.block_diagram import BlockDiagram, ExternalBlock, Service
from lapwing.cosim.diagram.compiled_loop import set_compiling
from lapwing.cosim.executors import realtime
from lapwing.cosim.executors.log_backpressure import LogBackpressure
from lapwing.cosim.executors.participant import Participant, Stopped
from lapwing.cosim.executors.realtime import Deadlines
from lapwing.cosim.processes.watchdog import SERVICE_LIMIT, Watchdog
from lapwing.cosim.run_errors import CutShortError, DivergedError
from lapwing.cosim.transport.bus_keys import BLOCK_TIME_KEY, DEADLINES_KEY, DIVERGED_KEY, ENDED_KEY, REPORTS_KEY
from lapwing.cosim.transport.packet_exchange import (
    PACKET_TICKS,
    EndOfRun,
    PacketReceiver,
    PacketSender,
    packet_receivers,
)
from lapwing.cosim.transport.packets import ticks_per_packet


def run_lockstep(
    process: Participant, service: Service, owns_time: bool, recorder: str, log: Path | None = None
) -> None:
    """Step `service` from tick 0 to the last tick of the run.

    An empty step packet is the last one of a service. The clock owner also publishes whether the run was completed.

    Args:
        process: the participant.
        service: service to step.
        owns_time: True if this process sets the pace and decides which tick is the last.
        recorder: the participant for whose log the clock owner waits.
        log: path of the log on this machine, if it is known: files of connected programs are kept beside it.

    Raises:
        Stopped: this process was requested to end.
        LockStepError: a message is missing or out of order, a state is invalid, or another participant ended early.
    """
    config = process.config

    def report_wait(text: str) -> None:
        if process.stopping:
            raise Stopped
        process.report_external_wait(text)

    with Watchdog(SERVICE_LIMIT, math.inf):
        diagram = BlockDiagram(config, [service], 2 * PACKET_TICKS)
        try:
            diagram.advance(0)  # steps no block, but compiles the loop over the blocks before the clock starts
            set_compiling("")
            receivers = packet_receivers(process, diagram)
            sender = PacketSender(process, service, diagram)
            backpressure = LogBackpressure(process, recorder) if owns_time else None
            diagram.open(report_wait, log)
            _run(process, diagram, receivers, sender, owns_time, backpressure)
        finally:
            diagram.close()


def _run(
    process: Participant,
    diagram: BlockDiagram,
    receivers: list[PacketReceiver],
    sender: PacketSender,
    owns_time: bool,
    backpressure: LogBackpressure | None,
) -> None:
    """Join the other participants, and step from tick 0 to the last tick of the run."""
    config = process.config
    process.join()
    sender.refresh_subscribers()
    if process.core is not None:
        pin(process.core)
        if process.speed is None:
            batch()
    if process.realtime:
        realtime.enter()
    tick_duration = config.interval / process.speed if process.speed is not None else None
    ticks_per_call = ticks_per_packet(config, process.name) if process.packs_ticks else 1
    deadlines, block_time = Deadlines(), 0.0
    started = time.perf_counter()
    try:
        while not diagram.ended:
            if process.stopping:
                raise Stopped
            tick = diagram.tick
            stop = min([receiver.receive(tick) for receiver in receivers], default=tick + 1)
            if backpressure:
                backpressure.wait_for_log(tick)
            if tick_duration is not None and owns_time:
                deadlines.note(_pace(started + tick * tick_duration))
            step_start = time.perf_counter()
            cpu_start = time.thread_time()
            diagram.advance(min(stop, tick + ticks_per_call))
            block_time += time.thread_time() - cpu_start
            sender.publish(tick, diagram.tick)
            if tick_duration is not None and not owns_time:
                deadlines.note(time.perf_counter() - step_start - tick_duration * (diagram.tick - tick))
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
    except DivergedError as error:  # published before the end of the run
        process.publish_final_status(DIVERGED_KEY, str(error))
        raise
    finally:
        if tick_duration is not None:
            process.publish_final_status(DEADLINES_KEY, deadlines.to_text())
        process.publish_final_status(BLOCK_TIME_KEY, f"{block_time:.6f}")
        if reports := diagram.reports:
            process.publish_final_status(REPORTS_KEY, json.dumps(reports))
        _leave(process, sender, diagram.tick)


def _leave(process: Participant, sender: PacketSender, stop: int) -> None:
    """Publish the remaining ticks before `stop`, and wait until all participants have received them."""
    sender.end(stop)
    process.confirm()
    process.leave(lambda: sender.publish_end(stop))


def run_encoder(process: Participant, service: Service) -> None:
    """Encode the messages of an external service, which publishes rows only.

    Args:
        process: the participant.
        service: its topic encoders are used, its blocks are not.

    Raises:
        Stopped: this process was requested to end.
        LockStepError: a step packet is missing or out of order.
    """
    ports = process.config.services[service.name].ports
    external = Service(service.name, [ExternalBlock(service.name, *ports)], service.encoders)
    diagram = BlockDiagram(process.config, [external], 2 * PACKET_TICKS)
    receiver = PacketReceiver(process, service.name, [(port.name, port.period, 0) for port in ports], diagram)
    sender = PacketSender(process, external, diagram, publishes_steps=False)
    process.join()
    sender.refresh_subscribers()
    try:
        while not process.stopping:
            tick = diagram.tick
            receiver.receive(tick)
            diagram.advance(tick + 1)
            sender.publish(tick, tick + 1)
    except EndOfRun:
        return
    finally:
        _leave(process, sender, diagram.tick)
    raise Stopped


def pin(core: int) -> None:
    """Keep all threads of this process on one core.

    With Gauss-Seidel coupling only one process works at a time, and a switch on one core costs half as much as waking
    another core (docs/reference/benchmarks.md).
    """
    if hasattr(os, "sched_setaffinity"):
        for thread in os.listdir("/proc/self/task"):
            with suppress(OSError):  # the thread has ended, or a sandbox does not permit it
                os.sched_setaffinity(int(thread), {core})


def batch() -> None:
    """Put this process into the scheduler's batch class (SCHED_BATCH), unless its class is not the default.

    A thread that this process wakes then runs when this process waits, instead of interrupting it. On a core that all
    services share, that saves a third of the thread switches (docs/reference/benchmarks.md).
    """
    if hasattr(os, "SCHED_BATCH") and os.sched_getscheduler(0) == os.SCHED_OTHER:
        for thread in os.listdir("/proc/self/task"):
            with suppress(OSError):  # the thread has ended, or a sandbox has no classes
                os.sched_setscheduler(int(thread), os.SCHED_BATCH, os.sched_param(0))


def _pace(when: float) -> float:
    """Sleep until `when` on the performance counter. Return the lateness [s], negative if it was early.

    A late run does not sleep until it is on time again.
    """
    remaining = when - time.perf_counter()
    if remaining > 0:
        time.sleep(remaining)
    return -remaining
