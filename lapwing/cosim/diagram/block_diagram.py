"""The parts of one or of all services of a run on their rows, ready to be run from tick to tick.

All executors run a graph: a process one with the parts of its own service, the single and the batch executor one with
the parts of all.
"""

from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.diagram.compiled_block import Block, BoundBlock, bind
from lapwing.cosim.diagram.execution_groups import ExecutionGroup, advance_all, groups
from lapwing.cosim.diagram.tick_schedule import LATCHED, Port
from lapwing.cosim.diagram.topic_encoder import RecordBatch, TopicEncoder, due_ticks, encode
from lapwing.cosim.run_errors import DivergedError, LockStepError
from lapwing.kernels.row_packing import pack_row, row_unpacker, row_width
from lapwing.messages.topics import Topic

NEVER = 2**62  # [tick]
SPARE = 8  # rows of a port beyond those of a page


class PythonBlock(Protocol):
    """A part that stays in Python: it acts at the ticks that it names, or when a part before it calls for it."""

    name: str
    outputs: tuple[Port, ...]

    def bind(self, graph: "BlockDiagram") -> None:
        """Get the graph whose rows it reads and writes, before the first tick."""
        ...

    def act(self, tick: int) -> int:
        """Do what is to be done at `tick`; the tick at which it has its next say, NEVER where it waits for a call."""
        ...


@dataclass
class Service:
    """A service of the lock step as it runs: its parts in their order, and its topics."""

    name: str
    parts: Sequence[Any]  # Part or PythonPart
    wires: Sequence[TopicEncoder]
    messages: list[tuple[Topic, int, bytes]] = field(default_factory=list)  # (topic, tick, payload) not yet fetched
    spoken: Sequence[Topic] = ()  # the topics of `messages`

    @property
    def topics(self) -> list[Topic]:
        """Every topic that it publishes."""
        return [*(wire.topic for wire in self.wires), *self.spoken]


class BlockDiagram:
    """Bound parts.

    Attributes:
        setup: the run.
        tick: the next tick.
        ended: whether the last tick of the run is over.
    """

    def __init__(
        self,
        setup: RunConfig,
        services: Sequence[Service],
        page: int,
        whole: Collection[str] = (),
        rows: dict[str, np.ndarray] | None = None,
    ):
        """Bind services, in their order of execution.

        Args:
            setup: the run.
            services: all of the run, or one.
            page: ticks that the rows keep at least, counted back from the newest.
            whole: ports of which every tick of the run is kept.
            rows: of a graph that is no longer wanted, which this one writes over where it has the same ports.
        """
        self.setup, self.services = setup, services
        self.tick, self.ended = 0, False
        parts = [part for service in services for part in service.parts]
        self.ports = dict(setup.ports)
        for part in parts:
            self.ports |= {port.name: port for port in part.outputs}
        used = {port.name for part in parts for port in part.outputs}
        used |= {i.port for part in parts for i in getattr(part, "inputs", ())}
        unknown = sorted(used - self.ports.keys())
        if unknown:
            raise LockStepError(f"no service of this scene gives {', '.join(unknown)}")
        delays: dict[str, int] = {}
        for part in parts:
            for i in getattr(part, "inputs", ()):
                delays[i.port] = max(delays.get(i.port, 0), i.delay)
        kept = {name: setup.last_tick + 1 if name in whole else page + delays.get(name, 0) for name in used}
        self._rows = {} if rows is None else rows
        for name in sorted(used):
            self._rows[name] = _ring(self.ports[name], kept[name], delays.get(name, 0), self._rows.get(name))
        self._readers: dict[str, Callable[[np.ndarray], Any]] = {}  # of the ports that somebody has asked for
        self._parts = parts
        self._codes: list[BoundBlock | None] = []
        for part in parts:
            self._codes.append(bind(part, self.ports, self._rows) if isinstance(part, Block) else None)
        self._turns = [ExecutionGroup(numbers, parts, self._codes) for numbers in groups(parts)]
        for part in parts:
            if not isinstance(part, Block):
                part.bind(self)

    def part(self, name: str) -> Block:
        """The compiled part of this name."""
        return next(part for part in self._parts if part.name == name)

    def prepare(self, part: Block) -> BoundBlock:
        """Compile or load a part that is to take another's place later."""
        return bind(part, self.ports, self._rows)

    def replace(self, part: Block, code: BoundBlock) -> None:
        """Put a prepared part in the place of the one of its name; it takes over the state that it was given."""
        k = self._parts.index(self.part(part.name))
        self._parts[k], self._codes[k] = part, code
        next(turn for turn in self._turns if k in turn.parts).replace(k, code)

    def advance(self, stop: int) -> None:
        """Run up to before the tick `stop`, or to the end of the run.

        Raises:
            LockStepError: the state of a part is no longer sound.
        """
        if self.ended:
            return
        stop, self.ended, failed = advance_all(self._turns, stop, self._act, self._failure)
        self.tick = max(self.tick, stop)
        if len(self._turns) > 1:
            for service in self.services:
                service.messages.sort(key=_tick)
        if failed is not None:
            raise failed

    def _act(self, part: int, tick: int) -> int:
        self._come_to(tick)
        return self._parts[part].act(tick)

    def _failure(self, part: int, tick: int) -> Exception:
        self._come_to(tick)
        return (self._parts[part].failure or _unsound(self._parts[part].name))(tick)

    def _come_to(self, tick: int) -> None:
        if len(self._turns) == 1:
            self.tick = tick

    def finish(self) -> None:
        """Let the present tick be the last; for a part in Python that owns time."""
        for turn in self._turns:
            turn.finish()

    def has(self, port: str) -> bool:
        """Whether somebody here gives or takes this port."""
        return port in self._rows

    def latest(self, port: str, tick: int) -> Any:
        """The value of a port at the last tick not after `tick` at which one was due."""
        period = max(1, self.ports[port].period)
        if port not in self._readers:
            self._readers[port] = row_unpacker(self.ports[port].like)
        return self._readers[port](self._rows[port][self._index(port, tick - tick % period)])

    def put(self, port: str, tick: int, value: Any) -> None:
        """Give the value of a port at `tick`."""
        self._rows[port][self._index(port, tick)] = pack_row(value)

    def put_row(self, port: str, tick: int, row: np.ndarray) -> None:
        """Give the value of a port at `tick` as numbers, shape (width,)."""
        self._rows[port][self._index(port, tick)] = row

    def put_rows(self, port: str, ticks: np.ndarray, rows: np.ndarray) -> None:
        """Give the values of a port at `ticks` (n,) as numbers, shape (n, width)."""
        self._rows[port][self._index(port, ticks)] = rows

    def row(self, port: str, tick: int) -> np.ndarray:
        """The numbers of a port at `tick`, shape (width,)."""
        return self._rows[port][self._index(port, tick)]

    def rows(self, port: str, ticks: np.ndarray) -> np.ndarray:
        """The rows of a port at `ticks` (n,), of which the newest are kept; shape (n, width)."""
        return self._rows[port][self._index(port, ticks)]

    def all_rows(self, port: str, every: int) -> np.ndarray:
        """The rows of a port that keeps all, at each `every` ticks from 0 up to now; a view, shape (n, width)."""
        period = self.ports[port].period
        return self._rows[port][: -(-self.tick // period)][:: every // period]

    def pages(
        self, first: int, stop: int, only: Iterable[Topic] | None = None, keep: bool = False
    ) -> list[RecordBatch]:
        """The messages of the ticks [first, stop).

        Args:
            first: the first tick.
            stop: the tick after the last.
            only: the topics wanted, None for all that are recorded.
            keep: whether single messages are to be given again by a later call.
        """
        wanted = None if only is None else set(only)
        found: list[RecordBatch] = []
        for service in self.services:
            for wire in service.wires:
                ticks = due_ticks(first, stop, wire.period)
                if len(ticks) and (wire.topic.recorded if wanted is None else wire.topic in wanted):
                    found += encode(wire, self.ports[wire.port], self.setup, ticks, self.rows(wire.port, ticks))
            said = [m for m in service.messages if first <= m[1] < stop and (wanted is None or m[0] in wanted)]
            found += pages_of(said)
            if not keep:
                service.messages = [m for m in service.messages if m[1] >= stop]
        return found

    def _index(self, port: str, ticks: Any) -> Any:
        period = self.ports[port].period
        return 0 if period == LATCHED else (ticks // period) & (len(self._rows[port]) - 1)


def pages_of(messages: Iterable[tuple[Topic, int, bytes]]) -> list[RecordBatch]:
    """Single messages (topic, tick, payload) as pages of messages of one length."""
    groups: dict[tuple[Topic, int], list[tuple[int, bytes]]] = {}
    for topic, tick, payload in messages:
        groups.setdefault((topic, len(payload)), []).append((tick, payload))
    found = []
    for (topic, size), group in groups.items():
        payloads = np.frombuffer(b"".join(payload for _, payload in group), np.uint8).reshape(-1, size)
        found.append(RecordBatch(topic, np.array([tick for tick, _ in group], np.int64), payloads))
    return found


def _ring(port: Port, ticks: int, delay: int, former: np.ndarray | None) -> np.ndarray:
    """Rows for so many ticks, in the memory of the former ones where these are as many."""
    rows = 1 if port.period == LATCHED else -(-ticks // port.period) + SPARE
    shape = 1 << (rows - 1).bit_length(), max(1, row_width(port.like))
    if former is None or former.shape != shape:
        return np.zeros(shape)
    former[: SPARE + delay] = former[-SPARE - delay :] = 0.0  # those read before they are written, of ticks before 0
    return former


def _tick(message: tuple[Topic, int, bytes]) -> int:
    return message[1]


def _unsound(name: str) -> Any:
    return lambda tick: DivergedError(f"{name}: the state is not sound at tick {tick}")
