"""Executable block diagram: the blocks of one or all services of a run, bound to the rows of their ports.

All executors run a diagram: a process one with the blocks of its service, the single-process and batch executors one
with the blocks of all services.
"""

from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.diagram.compiled_block import Block, BoundBlock, bind
from lapwing.cosim.diagram.execution_groups import ExecutionGroup, advance_groups, independent_groups
from lapwing.cosim.diagram.tick_schedule import LATCHED, Port
from lapwing.cosim.diagram.topic_encoder import RecordBatch, TopicEncoder, due_ticks, encode
from lapwing.cosim.run_errors import DivergedError, LockStepError
from lapwing.kernels.row_packing import pack_row, row_unpacker, row_width
from lapwing.messages.topics import Topic

NEVER = 2**62  # [tick]
SPARE = 8  # rows of a port beyond those of a page


class PythonBlock(Protocol):
    """Python block: it runs at the ticks that it requests, or when a block before it wakes it."""

    name: str
    outputs: tuple[Port, ...]

    def bind(self, graph: "BlockDiagram") -> None:
        """Store the diagram whose rows it reads and writes; called before the first tick."""
        ...

    def on_tick(self, tick: int) -> int:
        """Run the block at `tick`. Return the tick of its next wake-up, or NEVER to wait for another block."""
        ...


class ConnectedBlock(PythonBlock, Protocol):
    """A Python block with a connection to a program outside the run."""

    def open(self, waits: Callable[[str], None]) -> None:
        """Connect, before the first tick; call `waits` with what it waits for, again and again, here and in `act`."""
        ...

    def close(self) -> None:
        """End the connection."""
        ...

    @property
    def reports(self) -> dict[str, str]:
        """Entries of the log's metadata."""
        ...


@dataclass
class Service:
    """Running lock-step service: its blocks in their order, and its topics."""

    name: str
    parts: Sequence[Any]  # Part or PythonPart
    wires: Sequence[TopicEncoder]
    messages: list[tuple[Topic, int, bytes]] = field(default_factory=list)  # (topic, tick, payload) not yet fetched
    python_topics: Sequence[Topic] = ()  # the topics of `messages`

    @property
    def topics(self) -> list[Topic]:
        """Every topic that it publishes."""
        return [*(wire.topic for wire in self.wires), *self.python_topics]


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
            raise LockStepError(f"no service of this scene publishes {', '.join(unknown)}")
        delays: dict[str, int] = {}
        for part in parts:
            for i in getattr(part, "inputs", ()):
                delays[i.port] = max(delays.get(i.port, 0), i.delay)
        kept = {name: setup.last_tick + 1 if name in whole else page + delays.get(name, 0) for name in used}
        self._rows = {} if rows is None else rows
        for name in sorted(used):
            self._rows[name] = _ring(self.ports[name], kept[name], delays.get(name, 0), self._rows.get(name))
        self._readers: dict[str, Callable[[np.ndarray], Any]] = {}  # of the ports that were read
        self._parts = parts
        self._codes: list[BoundBlock | None] = []
        for part in parts:
            self._codes.append(bind(part, self.ports, self._rows) if isinstance(part, Block) else None)
        self._turns = [ExecutionGroup(numbers, parts, self._codes) for numbers in independent_groups(parts)]
        for part in parts:
            if not isinstance(part, Block):
                part.bind(self)

    @property
    def _connected(self) -> list[Any]:
        return [part for part in self._parts if hasattr(part, "reports")]

    def open(self, waits: Callable[[str], None] = lambda text: None) -> None:
        """Connect the blocks that have a connection; see `ConnectedBlock`."""
        for part in self._connected:
            part.open(waits)

    def close(self) -> None:
        """End these connections."""
        for part in self._connected:
            part.close()

    @property
    def reports(self) -> dict[str, str]:
        """Entries of these blocks for the log's metadata."""
        return {key: text for part in self._connected for key, text in part.reports.items()}

    def part(self, name: str) -> Block:
        """Return the compiled block of this name."""
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
            LockStepError: the state of a block is invalid.
        """
        if self.ended:
            return
        stop, self.ended, failed = advance_groups(self._turns, stop, self._act, self._failure)
        self.tick = max(self.tick, stop)
        if len(self._turns) > 1:
            for service in self.services:
                service.messages.sort(key=_tick)
        if failed is not None:
            raise failed

    def _act(self, part: int, tick: int) -> int:
        self._come_to(tick)
        return self._parts[part].on_tick(tick)

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
        """Return True if a block of this diagram reads or writes the port."""
        return port in self._rows

    def latest(self, port: str, tick: int) -> Any:
        """Return the value of a port at the last tick up to `tick` at which one was due."""
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
        """Return the row of a port at `tick`, shape (width,)."""
        return self._rows[port][self._index(port, tick)]

    def rows(self, port: str, ticks: np.ndarray) -> np.ndarray:
        """Return the rows of a port at recent `ticks` (n,), shape (n, width)."""
        return self._rows[port][self._index(port, ticks)]

    def history(self, port: str, every: int) -> np.ndarray:
        """Return the rows of a port with full history, every `every` ticks from 0; a view, shape (n, width)."""
        period = self.ports[port].period
        return self._rows[port][: -(-self.tick // period)][:: every // period]

    def record_batches(
        self, first: int, stop: int, only: Iterable[Topic] | None = None, keep: bool = False
    ) -> list[RecordBatch]:
        """Return the messages of the ticks [first, stop).

        Args:
            first: the first tick.
            stop: the tick after the last.
            only: the topics wanted, None for all that are recorded.
            keep: whether single messages are to be given again by a later call.
        """
        wanted = None if only is None else set(only)
        result: list[RecordBatch] = []
        for service in self.services:
            for wire in service.wires:
                ticks = due_ticks(first, stop, wire.period)
                if len(ticks) and (wire.topic.recorded if wanted is None else wire.topic in wanted):
                    result += encode(wire, self.ports[wire.port], self.setup, ticks, self.rows(wire.port, ticks))
            said = [m for m in service.messages if first <= m[1] < stop and (wanted is None or m[0] in wanted)]
            result += to_record_batches(said)
            if not keep:
                service.messages = [m for m in service.messages if m[1] >= stop]
        return result

    def _index(self, port: str, ticks: Any) -> Any:
        period = self.ports[port].period
        return 0 if period == LATCHED else (ticks // period) & (len(self._rows[port]) - 1)


def to_record_batches(messages: Iterable[tuple[Topic, int, bytes]]) -> list[RecordBatch]:
    """Single messages (topic, tick, payload) as pages of messages of one length."""
    groups: dict[tuple[Topic, int], list[tuple[int, bytes]]] = {}
    for topic, tick, payload in messages:
        groups.setdefault((topic, len(payload)), []).append((tick, payload))
    result = []
    for (topic, size), group in groups.items():
        payloads = np.frombuffer(b"".join(payload for _, payload in group), np.uint8).reshape(-1, size)
        result.append(RecordBatch(topic, np.array([tick for tick, _ in group], np.int64), payloads))
    return result


def _ring(port: Port, ticks: int, delay: int, former: np.ndarray | None) -> np.ndarray:
    """Return rows for `ticks` ticks, in the memory of the former ones if these have the same shape."""
    rows = 1 if port.period == LATCHED else -(-ticks // port.period) + SPARE
    shape = 1 << (rows - 1).bit_length(), max(1, row_width(port.like))
    if former is None or former.shape != shape:
        return np.zeros(shape)
    former[: SPARE + delay] = former[-SPARE - delay :] = 0.0  # those read before they are written, of ticks before 0
    return former


def _tick(message: tuple[Topic, int, bytes]) -> int:
    return message[1]


def _unsound(name: str) -> Any:
    return lambda tick: DivergedError(f"{name}: non-finite or invalid state at tick {tick}")
