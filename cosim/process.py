"""A participant of a run as a process of its own: joins the bus, waits for what is due, steps, publishes."""

import os
import signal
import threading
import time
from collections.abc import Callable
from typing import TypeVar

from cosim.bundle import Bundles, pack_batch
from cosim.bus import Subscription, ZenohBus
from cosim.graph import NEVER, Graph, Service
from cosim.schedule import LockStepError, Port, due
from cosim.serialise import first_difference, from_json, to_json
from cosim.setup import Setup
from dynamics.kernel import on_compile, uncompiled
from messages.topics import Topic

POLL = 0.1  # [s] between two looks at whether to stop
PATIENCE = 1.0  # [s] of waiting after which a service says what it waits for
BATCH = 0.1  # [s] of wall time between two batches
PAGE = 1024  # ticks after which a batch is handed over in any case
STEP_KEY, BATCH_KEY, WAITING_KEY, ALIVE_KEY, SETUP_KEY = "_step", "_batch", "_waiting", "_alive", "_setup"
COMPILING_KEY = "_compiling"
JOIN_TIMEOUT = 600.0  # [s] the others get to compile their kernels and to appear
ANSWER_TIMEOUT = 5.0  # [s] a participant gets to tell its set-up
FOUND_OUT = 3.0  # [s] for everybody to find a difference

T = TypeVar("T")
_due = uncompiled(due)


class EndOfRun(Exception):
    """A producer says that there will be no further message."""


class Stopped(Exception):
    """The process was asked to end."""


class Process:
    """A participant of a run: its bus, its set-up, and whether it was asked to stop."""

    def __init__(
        self,
        name: str,
        setup: Setup,
        bus: ZenohBus,
        space: str,
        others: list[str],
        speed: float | None = None,
        core: int | None = None,
        compares: bool = False,
    ):
        """A participant that is about to join.

        Args:
            name: its name among the participants.
            setup: what is flown.
            bus: the session.
            space: key space of the run.
            others: participants without which the run cannot begin.
            speed: simulated seconds per second, None for as fast as it goes.
            core: the core that all services of a sequential lock step share, None to leave it to the system.
            compares: whether the others may have another set-up, which is to be found out at joining.
        """
        self.compares = compares
        self.name, self.setup, self.bus, self.space = name, setup, bus, space
        self.others, self.speed, self.core = others, speed, core
        self.stopping = False
        self._compiling = False
        on_compile(self._tell_of_compiling)
        signal.signal(signal.SIGTERM, self._stop)
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # the launcher answers Ctrl-C for everybody

    def _stop(self, *_: object) -> None:
        self.stopping = True

    def _tell_of_compiling(self, _: str) -> None:
        if not self._compiling:
            self._compiling = True
            self.bus.publisher(f"{self.space}/{COMPILING_KEY}/{self.name}")(b"", 0)

    def end_with_parent(self) -> None:
        """Stop when the launcher, which holds the other end of standard input, is gone."""

        def watch() -> None:
            while os.read(0, 1):
                pass
            self.stopping = True

        threading.Thread(target=watch, daemon=True).start()

    def end_with(self, name: str) -> None:
        """Stop when another participant, who watches the run, is gone."""

        def changed(_: str, alive: bool) -> None:
            self.stopping = self.stopping or not alive

        self.bus.watch_alive(f"{self.space}/{ALIVE_KEY}/{name}", changed)

    def key(self, topic: Topic) -> str:
        """The Zenoh key of a topic in this run."""
        return topic.zenoh_key(self.setup.vehicle, self.space)

    def join(self) -> None:
        """Say that everything is subscribed, wait until everybody else has said so, and compare set-ups.

        Raises:
            Stopped: asked to end meanwhile.
            LockStepError: somebody did not come.
            ValueError: another participant has resolved something else; names the first difference.
        """
        self.bus.answer(f"{self.space}/{SETUP_KEY}/{self.name}", to_json(self.setup).encode())
        self.bus.declare_alive(f"{self.space}/{ALIVE_KEY}/{self.name}")
        wanted = [f"{self.space}/{ALIVE_KEY}/{other}" for other in self.others if other != self.name]
        missing = self.bus.wait_alive(wanted, timeout=JOIN_TIMEOUT, stop=lambda: self.stopping)
        if self.stopping:
            raise Stopped
        if missing:
            names = ", ".join(key.rsplit("/", 1)[1] for key in missing)
            raise LockStepError(f"{self.name}: nobody answers as {names}")
        if self.compares:
            self._compare()

    def _compare(self) -> None:
        """Refuse to fly with those who have resolved another scene."""
        own = to_json(self.setup)
        for other in self.others:
            if other == self.name:
                continue
            given = self.bus.ask(f"{self.space}/{SETUP_KEY}/{other}", ANSWER_TIMEOUT)
            if given is None or given.decode() == own:
                continue
            found = first_difference(self.setup, from_json(given.decode()))
            key, here, there = found or ("set-up", "?", "?")
            time.sleep(FOUND_OUT)  # this participant must still answer those who compare later
            raise ValueError(f"{self.name}: {key} is {here!r} here, {there!r} for {other}: resolve the same scene")

    def patient(self, get: Callable[[float], T | None], waiting_for: Callable[[], str]) -> T:
        """What `get(timeout)` gives; says on the bus what is waited for when that takes long.

        Raises:
            Stopped: asked to end.
        """
        waited = 0.0
        while not self.stopping:
            found = get(POLL)
            if found is not None:
                return found
            waited += POLL
            if waited >= PATIENCE:
                self.bus.publisher(f"{self.space}/{WAITING_KEY}/{self.name}")(waiting_for().encode(), 0)
                waited = 0.0
        raise Stopped


class Source:
    """A service that gives something that this one takes."""

    def __init__(self, process: Process, name: str, taken: list[tuple[str, int, int]], graph: Graph):
        """`taken`: (port, period, delay) of each input that it gives."""
        self._process, self._name, self._taken, self._graph = process, name, taken, graph
        self._bundles = Bundles(process.setup.services[name].ports)
        self._subscription: Subscription = process.bus.subscribe(f"{process.space}/{STEP_KEY}/{name}")
        self._newest = -1  # tick of the newest bundle taken

    def take(self, tick: int) -> None:
        """Take bundles up to the newest that is needed at `tick`.

        Raises:
            EndOfRun: the producer has ended.
            LockStepError: another bundle came than the one that is due.
        """
        needed = max(_due(tick, period, delay) for _, period, delay in self._taken)
        while self._newest < needed:
            stamp = self._newest + 1
            while not self._bundles.due(stamp):
                stamp += 1
            get = self._subscription.get
            time_ns, payload = get(POLL) or self._process.patient(get, lambda: self._describe(needed))
            if not payload:
                raise EndOfRun
            if time_ns != stamp * self._process.setup.interval_ns:
                raise LockStepError(f"{self._name}: expected the bundle of tick {stamp}, got {time_ns} ns")
            self._bundles.unpack(payload, self._graph, stamp)
            self._newest = stamp

    def _describe(self, tick: int) -> str:
        ports = [port for port, period, delay in self._taken if tick % period == 0]
        return f"{', '.join(ports)} of tick {tick} from {self._name}"


def sources(process: Process, graph: Graph) -> list[Source]:
    """Who gives what the service of this process takes."""
    setup = process.setup
    taken: dict[str, list[tuple[str, int, int]]] = {}
    for needed in setup.services[process.name].inputs:
        producer = setup.producers[needed.port]
        taken.setdefault(producer, []).append((needed.port, setup.port(needed.port).period, needed.delay))
    return [Source(process, producer, ports, graph) for producer, ports in sorted(taken.items())]


class Outlets:
    """What a service publishes: a bundle a tick to its consumers, batches to recorders, topics to those who listen."""

    def __init__(self, process: Process, service: Service, graph: Graph, hands_over: bool = True):
        """Declare the publishers; the bundles are somebody else's where it does not hand over."""
        space, bus = process.space, process.bus
        self._process, self._service, self._graph = process, service, graph
        self._bundles = Bundles(process.setup.services[service.name].ports if hands_over else ())
        self._put_bundle = bus.publisher(f"{space}/{STEP_KEY}/{service.name}") if hands_over else None
        self._put_batch = bus.publisher(f"{space}/{BATCH_KEY}/{service.name}")
        self._topics = {topic: process.key(topic) for topic in service.topics}
        self._puts = {topic: bus.publisher(key) for topic, key in self._topics.items()}
        self._listened: set[Topic] = set()
        self._handed = 0  # tick before which all is handed over
        self._due = 0.0
        self._interval_ns = process.setup.interval_ns

    def look(self) -> None:
        """See which topics somebody listens to."""
        self._listened = {topic for topic, key in self._topics.items() if self._process.bus.has_audience([key])}

    def publish(self, tick: int) -> None:
        """Hand over what the graph gives at `tick`."""
        if self._put_bundle and self._bundles.due(tick):
            self._put_bundle(self._bundles.pack(self._graph, tick), tick * self._interval_ns)
        if self._listened:
            for page in self._graph.pages(tick, tick + 1, self._listened, keep=True):
                for at, payload in zip(page.ticks, page.payloads, strict=True):
                    self._puts[page.topic](payload.tobytes(), int(at) * self._interval_ns)
        if tick + 1 - self._handed >= PAGE or time.monotonic() > self._due:
            self._hand_over(tick + 1)
            self.look()

    def _hand_over(self, stop: int) -> None:
        self._due = time.monotonic() + BATCH
        if stop > self._handed:
            pages = self._graph.pages(self._handed, stop)
            self._put_batch(pack_batch(pages, stop), (stop - 1) * self._interval_ns)
            self._handed = stop

    def end(self, stop: int) -> None:
        """Hand over what is left of the ticks before `stop`, and say that there will be no more."""
        self._hand_over(stop)
        time_ns = stop * self._interval_ns
        for put in (self._put_bundle, self._put_batch, *self._puts.values()):
            if put:
                put(b"", time_ns)


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
