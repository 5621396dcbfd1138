"""What a process takes from the bus and gives to it, tick by tick."""

import time
from collections.abc import Callable
from dataclasses import dataclass

from lapwing.cosim.diagram.block_diagram import BlockDiagram, Service
from lapwing.cosim.diagram.tick_schedule import due
from lapwing.cosim.executors.participant import PATIENCE, POLL, Participant
from lapwing.cosim.run_errors import LockStepError
from lapwing.cosim.transport.bus_keys import BATCH_KEY, WAITING_KEY
from lapwing.cosim.transport.packet_schedule import EACH_TICK, PacketSchedule, way, ways
from lapwing.cosim.transport.packets import PacketError, StepPacketCodec, pack_batch
from lapwing.cosim.transport.publish_watchdog import PublishWatchdog
from lapwing.kernels import python_function
from lapwing.messages.topics import Topic

BATCH = 0.1  # [s] of wall time between two batches
PAGE = 1024  # ticks after which a batch is handed over in any case

_due = python_function(due)


class EndOfRun(Exception):
    """A producer says that there will be no further message; its name."""


class PacketReceiver:
    """A service that gives something that this one takes."""

    def __init__(self, process: Participant, name: str, taken: list[tuple[str, int, int]], graph: BlockDiagram):
        """`taken`: (port, period, delay) of each input that it gives."""
        self._process, self._name, self._taken, self._graph = process, name, taken, graph
        self._way = way(process.setup, name, process.name) if process.bundles_ahead else EACH_TICK
        self._bundles = StepPacketCodec(self._way.ports(process.setup.services[name].ports), self._way.ticks)
        ((key, mark),) = process.participants.senders(self._way.key, [name]).items()
        self._inbox = process.bus.inbox(key, mark)
        self._needs = {(period, delay) for _, period, delay in taken}
        self._newest = -1  # tick up to which bundles are taken
        self._known = 0  # tick before which nothing more is needed

    def take(self, tick: int) -> int:
        """Take bundles up to the newest that is needed at `tick`; the tick before which nothing more is needed.

        Raises:
            EndOfRun: the producer has ended.
            LockStepError: another bundle came than the one that is due.
        """
        if tick < self._known:
            return self._known
        needed = max([_due(tick, period, delay) for period, delay in self._needs])
        while self._newest < needed:
            stamp = self._newest + 1
            while not self._bundles.due(stamp):
                stamp += self._way.every
            due_ns = stamp * self._process.setup.interval_ns
            time_ns, payload = self._inbox.get(POLL) or self._process.patient(
                self._inbox.get, lambda: self._describe(needed)
            )
            if not payload:
                raise EndOfRun(self._name)
            if time_ns != due_ns:
                raise LockStepError(f"{self._name}: expected the bundle of tick {stamp}, got {time_ns} ns")
            try:
                self._bundles.unpack(payload, self._graph, stamp)
            except PacketError as error:
                raise LockStepError(f"{self._name}: {error}") from None
            self._newest = stamp + self._way.every - 1
        self._known = min([(self._newest // period + 1) * period + delay for period, delay in self._needs])
        return self._known

    def _describe(self, tick: int) -> str:
        ports = [port for port, period, delay in self._taken if tick % period == 0]
        return f"{', '.join(ports)} of tick {tick} from {self._name}"


def sources(process: Participant, graph: BlockDiagram) -> list[PacketReceiver]:
    """Who gives what the service of this process takes."""
    setup = process.setup
    taken: dict[str, list[tuple[str, int, int]]] = {}
    for needed in setup.services[process.name].inputs:
        producer = setup.producers[needed.port]
        taken.setdefault(producer, []).append((needed.port, setup.port(needed.port).period, needed.delay))
    return [PacketReceiver(process, producer, ports, graph) for producer, ports in sorted(taken.items())]


@dataclass
class _Outlet:
    """The bundles to the consumers that take them the same way."""

    way: PacketSchedule
    bundles: StepPacketCodec
    put: Callable[[bytes, int], None]
    given: int = 0  # tick before which all has gone


class PacketSender:
    """What a service publishes: bundles to its consumers, batches to recorders, topics to those who listen."""

    def __init__(self, process: Participant, service: Service, graph: BlockDiagram, hands_over: bool = True):
        """Declare the publishers; the bundles are somebody else's where it does not hand over."""
        key_prefix, bus = process.key_prefix, process.bus
        self._process, self._graph = process, graph
        self._outlets = []
        if hands_over:
            for way in ways(process.setup, service.name) if process.bundles_ahead else {EACH_TICK}:
                put = bus.publisher(f"{key_prefix}/{way.key}/{service.name}")
                bundles = StepPacketCodec(way.ports(process.setup.services[service.name].ports), way.ticks)
                self._outlets.append(_Outlet(way, bundles, put))
        self._put_batch = bus.publisher(f"{key_prefix}/{BATCH_KEY}/{service.name}")
        self._topics = {topic: process.key(topic) for topic in service.topics}
        self._puts = {topic: bus.publisher(key, drops=True) for topic, key in self._topics.items()}
        self._listened: set[Topic] = set()
        self._handed = 0  # tick before which all is handed over
        self._due = 0.0
        self._interval_ns = process.setup.interval_ns
        bus.publisher(f"{key_prefix}/{WAITING_KEY}/{service.name}")  # declared while there is room
        self._delivery = PublishWatchdog(lambda: process.say(WAITING_KEY, "room on the way to somebody"), PATIENCE)

    def look(self) -> None:
        """See which topics somebody listens to."""
        self._listened = {topic for topic, key in self._topics.items() if self._process.bus.has_audience([key])}

    def publish(self, first: int, stop: int) -> None:
        """Hand over what the graph gives at the ticks [first, stop)."""
        with self._delivery:
            for outlet in self._outlets:
                while (given := outlet.given) + outlet.way.ticks <= stop:
                    if outlet.bundles.due(given):
                        outlet.put(outlet.bundles.pack(self._graph, given), given * self._interval_ns)
                    outlet.given += outlet.way.every
            if self._listened:
                for page in self._graph.pages(first, stop, self._listened, keep=True):
                    for at, payload in zip(page.ticks, page.payloads, strict=True):
                        self._puts[page.topic](payload.tobytes(), int(at) * self._interval_ns)
            if stop - self._handed >= PAGE or time.monotonic() > self._due:
                self._hand_over(stop)
                self._process.tell_of_refused()
                self.look()

    def _hand_over(self, stop: int) -> None:
        self._due = time.monotonic() + BATCH
        if stop > self._handed:
            pages = self._graph.pages(self._handed, stop)
            self._put_batch(pack_batch(pages, self._handed, stop), (stop - 1) * self._interval_ns)
            self._handed = stop

    def end(self, stop: int) -> None:
        """Hand over what is left of the ticks before `stop`, and say that there will be no more.

        Where who watches the run is gone, consumers are not told: they are to find that out, and not to take it for an
        end of the run.
        """
        self._delivery.close()
        self._hand_over(stop)
        self._process.tell_of_refused()
        self.say_end(stop)

    def say_end(self, stop: int) -> None:
        """Say that there will be no more from the tick `stop` on; whoever has heard it before takes no notice."""
        time_ns = stop * self._interval_ns
        bundles = [] if self._process.abandoned else [outlet.put for outlet in self._outlets]
        for put in (*bundles, self._put_batch, *self._puts.values()):
            put(b"", time_ns)
