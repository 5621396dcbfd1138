"""Exchange of step packets with other participants over the bus."""

import math
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass

from lapwing.cosim.diagram.block_diagram import BlockDiagram, Service
from lapwing.cosim.diagram.tick_schedule import due
from lapwing.cosim.executors.participant import PATIENCE, POLL, Participant
from lapwing.cosim.run_errors import LockStepError
from lapwing.cosim.transport.bus_keys import BATCH_KEY, WAITING_KEY
from lapwing.cosim.transport.packets import (
    EACH_TICK,
    PacketError,
    PacketSchedule,
    StepPacketCodec,
    pack_log_packet,
    packet_schedule,
    packet_schedules,
)
from lapwing.kernels import python_function
from lapwing.messages.topics import Topic

LOG_PERIOD = 0.1  # [s] of wall time between two log packets
WATCH_PERIOD = 0.2  # [s] between two checks of the watchdog
PACKET_TICKS = 1024  # [ticks] limit of a log packet

_due = python_function(due)


class EndOfRun(Exception):
    """A producer has published its last message; the argument is its name."""


class PacketReceiver:
    """Receiver of the step packets of one producer."""

    def __init__(self, process: Participant, name: str, inputs: list[tuple[str, int, int]], diagram: BlockDiagram):
        """Subscribe to the service `name`; `inputs` has (port, period, delay) of each input that it produces."""
        self._process, self._name, self._inputs, self._diagram = process, name, inputs, diagram
        self._schedule = packet_schedule(process.config, name, process.name) if process.packs_ticks else EACH_TICK
        self._codec = StepPacketCodec(self._schedule.ports(process.config.services[name].ports), self._schedule.ticks)
        ((key, gid),) = process.participants.senders(self._schedule.key, [name]).items()
        self._inbox = process.bus.inbox(key, gid)
        self._timings = {(period, delay) for _, period, delay in inputs}
        self._newest = -1  # last tick whose packets have been received
        self._complete_before = 0  # all inputs of the ticks before this one have been received

    def receive(self, tick: int) -> int:
        """Receive step packets up to the newest one that is due at `tick`. Return the first tick with missing inputs.

        Raises:
            EndOfRun: the producer has ended.
            LockStepError: a step packet is out of order or invalid.
        """
        if tick < self._complete_before:
            return self._complete_before
        newest_due = max([_due(tick, period, delay) for period, delay in self._timings])
        while self._newest < newest_due:
            packet_tick = self._newest + 1
            while not self._codec.due(packet_tick):
                packet_tick += self._schedule.every
            expected_ns = packet_tick * self._process.config.interval_ns
            time_ns, payload = self._inbox.get(POLL) or self._process.wait_with_status(
                self._inbox.get, lambda: self._describe(newest_due)
            )
            if not payload:
                raise EndOfRun(self._name)
            if time_ns != expected_ns:
                raise LockStepError(f"{self._name}: expected the step packet of tick {packet_tick}, got {time_ns} ns")
            try:
                self._codec.unpack(payload, self._diagram, packet_tick)
            except PacketError as error:
                raise LockStepError(f"{self._name}: {error}") from None
            self._newest = packet_tick + self._schedule.every - 1
        self._complete_before = min([(self._newest // period + 1) * period + delay for period, delay in self._timings])
        return self._complete_before

    def _describe(self, tick: int) -> str:
        ports = [port for port, period, delay in self._inputs if tick % period == 0]
        return f"{', '.join(ports)} of tick {tick} from {self._name}"


def packet_receivers(process: Participant, diagram: BlockDiagram) -> list[PacketReceiver]:
    """Return a receiver for each producer of an input of this process's service."""
    config = process.config
    inputs: dict[str, list[tuple[str, int, int]]] = {}
    for i in config.services[process.name].inputs:
        producer = config.producers[i.port]
        inputs.setdefault(producer, []).append((i.port, config.port(i.port).period, i.delay))
    return [PacketReceiver(process, producer, ports, diagram) for producer, ports in sorted(inputs.items())]


@dataclass
class _StepOutlet:
    """Publisher of step packets to the consumers with one packet schedule."""

    schedule: PacketSchedule
    codec: StepPacketCodec
    put: Callable[[bytes, int], None]
    next_tick: int = 0  # first tick of the next packet

    def publish(self, diagram: BlockDiagram, stop: int, interval_ns: int) -> None:
        """Publish the packets that are complete before the tick `stop`."""
        while (tick := self.next_tick) + self.schedule.ticks <= stop:
            if self.codec.due(tick):
                self.put(self.codec.pack(diagram, tick), tick * interval_ns)
            self.next_tick += self.schedule.every


class _TopicPublisher:
    """Publisher of messages on the keys of topics with subscribers."""

    def __init__(self, process: Participant, service: Service):
        self._bus = process.bus
        self._keys = {topic: process.key(topic) for topic in service.topics}
        self.publishers = {topic: process.bus.publisher(key, drops=True) for topic, key in self._keys.items()}
        self._subscribed: set[Topic] = set()

    def refresh_subscribers(self) -> None:
        """Store which topics have subscribers."""
        self._subscribed = {topic for topic, key in self._keys.items() if self._bus.has_subscribers([key])}

    def publish(self, diagram: BlockDiagram, first: int, stop: int, interval_ns: int) -> None:
        """Publish the messages of the ticks [first, stop)."""
        if self._subscribed:
            for batch in diagram.record_batches(first, stop, self._subscribed, keep=True):
                for at, payload in zip(batch.ticks, batch.payloads, strict=True):
                    self.publishers[batch.topic](payload.tobytes(), int(at) * interval_ns)


class PublishWatchdog:
    """Watchdog that reports a blocked publishing thread from a separate thread.

    The run monitor then names the consumer that accepts no data, and not the producer that waits for it.
    """

    def __init__(self, report: Callable[[], None], patience: float):
        """Call `report` after every `patience` [s] of work within this context."""
        self._report, self._patience = report, patience
        self._entered = self._reported = math.inf  # [s] of the monotonic clock; infinite while nothing is published
        self._closed = threading.Event()
        threading.Thread(target=self._watch, daemon=True).start()

    def __enter__(self) -> None:
        self._entered = time.monotonic()

    def __exit__(self, *_: object) -> None:
        self._entered = math.inf

    def close(self) -> None:
        """Stop the thread."""
        self._closed.set()

    def _watch(self) -> None:
        while not self._closed.wait(WATCH_PERIOD):
            entered, now = self._entered, time.monotonic()
            if now - entered < self._patience:
                self._reported = -math.inf
            elif now - self._reported >= self._patience:
                self._reported = now
                self._report()


class PacketSender:
    """Publisher of the output of a service: step packets, log packets, and topics with subscribers."""

    def __init__(self, process: Participant, service: Service, diagram: BlockDiagram, publishes_steps: bool = True):
        """Declare the publishers; without `publishes_steps`, an external program publishes the step packets."""
        key_prefix, bus = process.key_prefix, process.bus
        self._process, self._diagram = process, diagram
        self._outlets = []
        if publishes_steps:
            for schedule in packet_schedules(process.config, service.name) if process.packs_ticks else {EACH_TICK}:
                put = bus.publisher(f"{key_prefix}/{schedule.key}/{service.name}")
                codec = StepPacketCodec(schedule.ports(process.config.services[service.name].ports), schedule.ticks)
                self._outlets.append(_StepOutlet(schedule, codec, put))
        self._put_log = bus.publisher(f"{key_prefix}/{BATCH_KEY}/{service.name}")
        self._topics = _TopicPublisher(process, service)
        self._logged = 0  # first tick that is not in a log packet
        self._log_due = 0.0  # [s] of the monotonic clock
        self._interval_ns = process.config.interval_ns
        bus.publisher(f"{key_prefix}/{WAITING_KEY}/{service.name}")  # declared early, before queues are full
        self._watchdog = PublishWatchdog(
            lambda: process.publish_status(WAITING_KEY, "a consumer that accepts no data"), PATIENCE
        )

    def refresh_subscribers(self) -> None:
        """Check again which topics have subscribers."""
        self._topics.refresh_subscribers()

    def publish(self, first: int, stop: int) -> None:
        """Publish the output of the ticks [first, stop)."""
        with self._watchdog:
            for outlet in self._outlets:
                outlet.publish(self._diagram, stop, self._interval_ns)
            self._topics.publish(self._diagram, first, stop, self._interval_ns)
            if stop - self._logged >= PACKET_TICKS or time.monotonic() > self._log_due:
                self._publish_log(stop)
                self._process.report_rejected()
                self.refresh_subscribers()

    def _publish_log(self, stop: int) -> None:
        self._log_due = time.monotonic() + LOG_PERIOD
        if stop > self._logged:
            batches = self._diagram.record_batches(self._logged, stop)
            self._put_log(pack_log_packet(batches, self._logged, stop), (stop - 1) * self._interval_ns)
            self._logged = stop

    def end(self, stop: int) -> None:
        """Publish the remaining ticks before `stop`, then the end (`publish_end`)."""
        self._watchdog.close()
        self._publish_log(stop)
        self._process.report_rejected()
        self.publish_end(stop)

    def publish_end(self, stop: int) -> None:
        """Publish an empty packet on each key: there is no output from the tick `stop` on. May be repeated.

        Consumers get none if the run monitor has left: they must detect that themselves instead of seeing a normal end.
        """
        steps = [] if self._process.abandoned else [outlet.put for outlet in self._outlets]
        for put in (*steps, self._put_log, *self._topics.publishers.values()):
            put(b"", stop * self._interval_ns)
