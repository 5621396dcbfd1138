"""Executable block diagram: the blocks of one or all services of a run, bound to the rows of their ports.

A service process runs a diagram of the blocks of its service; the single-process and batch executors run a diagram of
the blocks of all services.
"""

from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import dataclass, field
from operator import itemgetter
from typing import Any

import numpy as np

from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.diagram.compiled_block import Block, BoundBlock, bind
from lapwing.cosim.diagram.execution_groups import ExecutionGroup, advance_groups, independent_groups
from lapwing.cosim.diagram.tick_schedule import LATCHED, Port
from lapwing.cosim.diagram.topic_encoder import RecordBatch, TopicEncoder, due_ticks, encode, to_record_batches
from lapwing.cosim.run_errors import DivergedError, LockStepError
from lapwing.kernels.row_packing import pack_row, row_unpacker, row_width
from lapwing.messages.topics import Topic

NEVER = 2**62  # [tick]
SPARE = 8  # rows of a port in addition to those of a tick block


@dataclass
class Service:
    """Running lock-step service: its blocks in their order, and its topics.

    A block is a compiled `Block`, or a Python object with a `name`, `outputs` (ports), and the methods `bind(diagram)`,
    called before the first tick, and `on_tick(tick)`, which runs the block and returns the tick of its next wake-up, or
    NEVER to wait for another block. If it has a connection to a program outside the run, it also has
    `open(report_wait)`, `close()` and `reports`, entries of the log's metadata; each wait, in `open` and `on_tick`,
    calls `report_wait` with a text.
    """

    name: str
    parts: Sequence[Any]
    wires: Sequence[TopicEncoder]
    messages: list[tuple[Topic, int, bytes]] = field(default_factory=list)  # (topic, tick, payload) not yet fetched
    python_topics: Sequence[Topic] = ()  # the topics of `messages`

    @property
    def topics(self) -> list[Topic]:
        """All topics that it publishes."""
        return [*(wire.topic for wire in self.wires), *self.python_topics]


class ExternalBlock:
    """Block whose outputs are written from outside of the diagram."""

    def __init__(self, name: str, *outputs: Port):
        self.name, self.outputs = name, outputs

    def bind(self, graph: "BlockDiagram") -> None:
        """Do nothing."""

    def on_tick(self, tick: int) -> int:
        """Return NEVER: the outputs are written from outside."""
        return NEVER


class BlockDiagram:
    """Block diagram of one or more services.

    Attributes:
        setup: run configuration.
        tick: next tick.
        ended: True after the last tick of the run.
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
            setup: run configuration.
            services: all services of the run, or one.
            page: number of most recent ticks whose rows are kept.
            whole: names of the ports with full history.
            rows: rows of a diagram that is no longer needed; their memory is reused if the shape is equal.
        """
        self.setup, self.services = setup, services
        self.tick, self.ended = 0, False
        parts = [part for service in services for part in service.parts]
        self.ports = dict(setup.ports)
        for part in parts:
            self.ports |= {port.name: port for port in part.outputs}
        port_names = {port.name for part in parts for port in part.outputs}
        port_names |= {i.port for part in parts for i in getattr(part, "inputs", ())}
        unknown = sorted(port_names - self.ports.keys())
        if unknown:
            raise LockStepError(f"no service of this scene publishes {', '.join(unknown)}")
        delays: dict[str, int] = {}
        for part in parts:
            for i in getattr(part, "inputs", ()):
                delays[i.port] = max(delays.get(i.port, 0), i.delay)
        depths = {name: setup.last_tick + 1 if name in whole else page + delays.get(name, 0) for name in port_names}
        self._rows = {} if rows is None else rows
        for name in sorted(port_names):
            self._rows[name] = _ring(self.ports[name], depths[name], delays.get(name, 0), self._rows.get(name))
        self._readers: dict[str, Callable[[np.ndarray], Any]] = {}  # by port
        self._parts = parts
        self._codes: list[BoundBlock | None] = []
        for part in parts:
            self._codes.append(bind(part, self.ports, self._rows) if isinstance(part, Block) else None)
        self._groups = [ExecutionGroup(numbers, parts, self._codes) for numbers in independent_groups(parts)]
        for part in parts:
            if not isinstance(part, Block):
                part.bind(self)

    @property
    def _connected(self) -> list[Any]:
        return [part for part in self._parts if hasattr(part, "reports")]

    def open(self, report_wait: Callable[[str], None] = lambda text: None) -> None:
        """Connect the blocks that have a connection; see `Service`."""
        for part in self._connected:
            part.open(report_wait)

    def close(self) -> None:
        """Close the connections of these blocks."""
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
        """Compile or load a block that replaces another one later."""
        return bind(part, self.ports, self._rows)

    def replace(self, part: Block, code: BoundBlock) -> None:
        """Replace the block of the same name by a prepared one, which starts from its own state."""
        k = self._parts.index(self.part(part.name))
        self._parts[k], self._codes[k] = part, code
        next(group for group in self._groups if k in group.parts).replace(k, code)

    def advance(self, stop: int, on_tick: Callable[[Any, int], int] | None = None) -> None:
        """Run to the tick `stop` (exclusive), or to the end of the run.

        Args:
            stop: last tick (exclusive).
            on_tick: function that is called with a Python block and the tick in place of the block's `on_tick`; it
                calls that method and returns its result.

        Raises:
            LockStepError: the state of a block is invalid.
        """
        if self.ended:
            return

        def act(part: int, tick: int) -> int:
            self._set_tick(tick)
            block = self._parts[part]
            return block.on_tick(tick) if on_tick is None else on_tick(block, tick)

        stop, self.ended, failed = advance_groups(self._groups, stop, act, self._failure)
        self.tick = max(self.tick, stop)
        if len(self._groups) > 1:
            for service in self.services:
                service.messages.sort(key=itemgetter(1))
        if failed is not None:
            raise failed

    def _failure(self, part: int, tick: int) -> Exception:
        self._set_tick(tick)
        return (self._parts[part].failure or _divergence_error(self._parts[part].name))(tick)

    def _set_tick(self, tick: int) -> None:
        if len(self._groups) == 1:
            self.tick = tick

    def finish(self) -> None:
        """End the run after the current tick; for Python blocks."""
        for group in self._groups:
            group.finish()

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
        """Set the value of a port at `tick`."""
        self._rows[port][self._index(port, tick)] = pack_row(value)

    def put_row(self, port: str, tick: int, row: np.ndarray) -> None:
        """Set the row of a port at `tick`, shape (width,)."""
        self._rows[port][self._index(port, tick)] = row

    def put_rows(self, port: str, ticks: np.ndarray, rows: np.ndarray) -> None:
        """Set the rows of a port at `ticks` (n,), shape (n, width)."""
        self._rows[port][self._index(port, ticks)] = rows

    def row(self, port: str, tick: int) -> np.ndarray:
        """Return the row of a port at `tick`, shape (width,)."""
        return self._rows[port][self._index(port, tick)]

    def ring(self, port: str) -> np.ndarray:
        """Return the ring buffer of a port, shape (2^k, width); the row of a tick is number tick // period mod 2^k."""
        return self._rows[port]

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
            first: first tick.
            stop: last tick (exclusive).
            only: topics to return; None for all recorded topics.
            keep: True to return the messages of Python blocks again in a later call.
        """
        topics = None if only is None else set(only)
        result: list[RecordBatch] = []
        for service in self.services:
            for wire in service.wires:
                ticks = due_ticks(first, stop, wire.period)
                if len(ticks) and (wire.topic.recorded if topics is None else wire.topic in topics):
                    result += encode(wire, self.ports[wire.port], self.setup, ticks, self.rows(wire.port, ticks))
            python_messages = [
                m for m in service.messages if first <= m[1] < stop and (topics is None or m[0] in topics)
            ]
            result += to_record_batches(python_messages)
            if not keep:
                service.messages = [m for m in service.messages if m[1] >= stop]
        return result

    def _index(self, port: str, ticks: Any) -> Any:
        period = self.ports[port].period
        return 0 if period == LATCHED else (ticks // period) & (len(self._rows[port]) - 1)


def _ring(port: Port, ticks: int, delay: int, former: np.ndarray | None) -> np.ndarray:
    """Return rows for `ticks` ticks, in the memory of `former` if it has the same shape."""
    rows = 1 if port.period == LATCHED else -(-ticks // port.period) + SPARE
    shape = 1 << (rows - 1).bit_length(), max(1, row_width(port.like))
    if former is None or former.shape != shape:
        return np.zeros(shape)
    former[: SPARE + delay] = former[-SPARE - delay :] = 0.0  # rows of ticks before 0 are read before they are written
    return former


def _divergence_error(name: str) -> Any:
    return lambda tick: DivergedError(f"{name}: non-finite or invalid state at tick {tick}")
