"""Executable block diagram: the blocks of one or all services of a run, bound to the rows of their ports.

A service process runs a diagram of the blocks of its service; the single-process and batch executors run a diagram of
the blocks of all services.
"""

from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import dataclass, field
from functools import partial
from operator import itemgetter
from pathlib import Path
from typing import Any

import numpy as np

from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.diagram.compiled_block import Block, BoundBlock, bind
from lapwing.cosim.diagram.execution_groups import ExecutionGroup, advance_groups, independent_groups
from lapwing.cosim.diagram.port_rows import PortRows
from lapwing.cosim.diagram.tick_schedule import Port
from lapwing.cosim.diagram.topic_encoder import RecordBatch, TopicEncoder, encode, to_record_batches
from lapwing.cosim.run_errors import DivergedError, LockStepError
from lapwing.messages.topics import Topic

NEVER = 2**62  # [tick]


@dataclass
class Service:
    """Lock-step service of a run: its blocks in order of execution, and its topic encoders.

    A block is a compiled `Block`, or a Python object with a `name`, `outputs` (ports), and the methods `bind(diagram)`,
    called before the first tick, and `on_tick(tick)`, which runs the block and returns the tick of its next wake-up, or
    NEVER to wait for another block. If it has a connection to a program outside the run, it also has
    `open(report_wait, log)`, `close()` and `reports`, entries of the log's metadata. Each wait, in `open` and
    `on_tick`, calls `report_wait` with a text; files of the program are kept beside `log`, the path of the log or None.
    """

    name: str
    blocks: Sequence[Any]
    encoders: Sequence[TopicEncoder]
    messages: list[tuple[Topic, int, bytes]] = field(default_factory=list)  # (topic, tick, payload) not yet fetched
    python_topics: Sequence[Topic] = ()  # the topics of `messages`

    @property
    def topics(self) -> list[Topic]:
        """Topics that the service publishes."""
        return [*(encoder.topic for encoder in self.encoders), *self.python_topics]


class ExternalBlock:
    """Block whose outputs are written from outside of the diagram."""

    def __init__(self, name: str, *outputs: Port):
        self.name, self.outputs = name, outputs

    def bind(self, diagram: "BlockDiagram") -> None:
        """Do nothing."""

    def on_tick(self, tick: int) -> int:
        """Return NEVER: the outputs are written from outside."""
        return NEVER


def is_connected(block: Any) -> bool:
    """Return True if a block has a connection to a program outside the run: its class has `reports`."""
    return hasattr(type(block), "reports")  # of a block, an error in that property would count as its absence


class BlockDiagram(PortRows):
    """Block diagram of one or more services.

    Attributes:
        config: run configuration.
        tick: next tick.
        ended: True after the last tick of the run.
    """

    def __init__(
        self,
        config: RunConfig,
        services: Sequence[Service],
        kept_ticks: int,
        full_history: Collection[str] = (),
        rows: dict[str, np.ndarray] | None = None,
    ):
        """Bind services, in their order of execution.

        Args:
            config: run configuration.
            services: all services of the run, or one.
            kept_ticks: number of most recent ticks whose rows are kept.
            full_history: names of the ports with all their samples.
            rows: rows of a diagram that is no longer needed; their memory is reused if the shape is equal.
        """
        self.config, self.services = config, services
        self.tick, self.ended = 0, False
        blocks = [block for service in services for block in service.blocks]
        ports = dict(config.ports)
        for block in blocks:
            ports |= {port.name: port for port in block.outputs}
        port_names = {port.name for block in blocks for port in block.outputs}
        port_names |= {i.port for block in blocks for i in getattr(block, "inputs", ())}
        unknown = sorted(port_names - ports.keys())
        if unknown:
            raise LockStepError(f"no service of this scene publishes {', '.join(unknown)}")
        delays: dict[str, int] = {}
        for block in blocks:
            for i in getattr(block, "inputs", ()):
                delays[i.port] = max(delays.get(i.port, 0), i.delay)
        for encoder in (encoder for service in services for encoder in service.encoders if encoder.on_change):
            delays[encoder.port] = max(delays.get(encoder.port, 0), 1)
        depths = {
            name: config.last_tick + 1 if name in full_history else kept_ticks + delays.get(name, 0)
            for name in port_names
        }
        super().__init__(ports, depths, delays, rows)
        self._blocks = blocks
        self._codes: list[BoundBlock | None] = []
        for block in blocks:
            self._codes.append(bind(block, self.ports, self._rows) if isinstance(block, Block) else None)
        self._groups = [ExecutionGroup(numbers, blocks, self._codes) for numbers in independent_groups(blocks)]
        for block in blocks:
            if not isinstance(block, Block):
                block.bind(self)

    @property
    def _connected(self) -> list[Any]:
        return [block for block in self._blocks if is_connected(block)]

    def open(self, report_wait: Callable[[str], None] = lambda text: None, log: Path | None = None) -> None:
        """Connect the blocks to their programs outside the run. `report_wait` receives a text for each wait."""
        for block in self._connected:
            block.open(report_wait, log)

    def close(self) -> None:
        """Close the connections to programs outside the run."""
        for block in self._connected:
            block.close()

    @property
    def reports(self) -> dict[str, str]:
        """Entries for the log's metadata from the blocks with a connection to a program outside the run."""
        return {key: text for block in self._connected for key, text in block.reports.items()}

    def block(self, name: str) -> Block:
        """Return the compiled block of this name."""
        return next(block for block in self._blocks if block.name == name)

    def prepare(self, block: Block) -> BoundBlock:
        """Compile or load a block that replaces another one later."""
        return bind(block, self.ports, self._rows)

    def replace(self, block: Block, code: BoundBlock) -> None:
        """Replace the block of the same name by a prepared one, which continues from the state in its own cell."""
        k = self._blocks.index(self.block(block.name))
        self._blocks[k], self._codes[k] = block, code
        next(group for group in self._groups if k in group.blocks).replace(k, code)

    def advance(self, stop: int, on_tick: Callable[[Any, int], int] | None = None) -> None:
        """Run to the tick `stop` (exclusive), or to the end of the run.

        Args:
            stop: last tick (exclusive).
            on_tick: function that is called with a Python block and the tick in place of the block's `on_tick`; it
                calls that method and returns its result.

        Raises:
            LockStepError: the state of a block is invalid, or a Python block failed.
        """
        if self.ended:
            return

        def act(number: int, tick: int) -> int:
            self._set_tick(tick)
            python = self._blocks[number]
            return python.on_tick(tick) if on_tick is None else on_tick(python, tick)

        stop, self.ended, failed = advance_groups(self._groups, stop, act, self._failure)
        self.tick = max(self.tick, stop)
        if len(self._groups) > 1:
            for service in self.services:
                service.messages.sort(key=itemgetter(1))
        if failed is not None:
            raise failed

    def _failure(self, number: int, tick: int) -> Exception:
        self._set_tick(tick)
        return (self._blocks[number].failure or _divergence_error(self._blocks[number].name))(tick)

    def _set_tick(self, tick: int) -> None:
        if len(self._groups) == 1:
            self.tick = tick

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
            for encoder in service.encoders:
                if not (encoder.topic.recorded if topics is None else encoder.topic in topics):
                    continue
                rows = partial(self.rows, encoder.port)
                if len(ticks := encoder.message_ticks(first, stop, rows)):
                    result += encode(encoder, self.ports[encoder.port], self.config, ticks, rows(ticks))
            python_messages = [
                m for m in service.messages if first <= m[1] < stop and (topics is None or m[0] in topics)
            ]
            result += to_record_batches(python_messages)
            if not keep:
                service.messages = [m for m in service.messages if m[1] >= stop]
        return result


def _divergence_error(name: str) -> Any:
    return lambda tick: DivergedError(f"{name}: non-finite or invalid state at tick {tick}")
