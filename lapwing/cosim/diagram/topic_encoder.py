"""Conversion of port rows into messages: one topic encoder for each topic, in the services' `encoders.py`.

An encoder converts many rows in one call: `fields` returns the columns of the message's numbers, `sample` a message
that fixes its texts and the lengths of its sequences. If texts change during a run, rows hold their indices in the
service's table of texts, and a batch is split into parts of the same texts.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.diagram.tick_schedule import Port
from lapwing.kernels.row_packing import columns
from lapwing.messages.cdr_arrays import Record
from lapwing.messages.topics import Topic

Fields = Mapping[str, Any]  # by field name: a column (n,) or (n, k), a scalar, or a function that returns one of these


@dataclass(frozen=True)
class TopicEncoder:
    """Conversion of a port's rows into the messages of a topic.

    Attributes:
        topic: the topic.
        port: name of the port.
        period: ticks between two messages; a multiple of the port's.
        fields: (columns of the port's tree, instants [ns] (n,) of int64) to the message's fields.
        sample: function that returns a message with the texts of a key; the key is () if `texts` is None.
        texts: function that returns the columns of the key, each (n,): indices into the tables of texts.
        on_change: True for a message also at every tick at which the port's row differs from that before; the port's
            period is then 1.
    """

    topic: Topic
    port: str
    period: int
    fields: Callable[[Any, np.ndarray], Fields]
    sample: Callable[..., Any]
    texts: Callable[[Any], Sequence[np.ndarray]] | None = None
    on_change: bool = False

    def message_ticks(self, first: int, stop: int, rows: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
        """Return the ticks of [first, stop) that have a message, (n,) int64.

        `rows` returns the port's rows at ticks from first - 1 on, shape (n, width).
        """
        due = due_ticks(first, stop, self.period)
        if not self.on_change or stop < 2:
            return due
        before = max(first - 1, 0)
        values = rows(np.arange(before, stop))
        return np.union1d(due, before + 1 + np.flatnonzero((values[1:] != values[:-1]).any(axis=1)))


class RecordBatch(NamedTuple):
    """Messages of one topic and of one shape."""

    topic: Topic
    ticks: np.ndarray  # (n,) int64
    payloads: np.ndarray  # (n,) records of the message


def split_at(batches: Iterable[RecordBatch], stop: int) -> tuple[list[RecordBatch], list[RecordBatch]]:
    """Return (messages before tick `stop`, messages from it on), without empty batches."""
    before, after = [], []
    for batch in batches:
        k = int(np.searchsorted(batch.ticks, stop))
        if k > 0:
            before.append(RecordBatch(batch.topic, batch.ticks[:k], batch.payloads[:k]))
        if k < len(batch.ticks):
            after.append(RecordBatch(batch.topic, batch.ticks[k:], batch.payloads[k:]))
    return before, after


def encode(
    encoder: TopicEncoder, port: Port, config: RunConfig, ticks: np.ndarray, rows: np.ndarray
) -> Iterator[RecordBatch]:
    """Yield the messages of a topic at `ticks` (n,), from the rows (n, width) of its port at these ticks."""
    tree = columns(port.example, rows)
    if encoder.texts is None:
        yield _record_batch(encoder, encoder.sample(), tree, ticks, config)
        return
    keys = np.stack([np.asarray(column, np.int64) for column in encoder.texts(tree)], axis=1)
    for key in np.unique(keys, axis=0):
        selected = np.flatnonzero((keys == key).all(axis=1))
        part = columns(port.example, rows[selected]) if len(selected) < len(ticks) else tree
        yield _record_batch(encoder, encoder.sample(*key.tolist()), part, ticks[selected], config)


def _record_batch(encoder: TopicEncoder, sample: Any, tree: Any, ticks: np.ndarray, config: RunConfig) -> RecordBatch:
    fields = encoder.fields(tree, ticks * config.interval_ns)
    return RecordBatch(encoder.topic, ticks, Record.of(sample).encode(len(ticks), fields))


def due_ticks(first: int, stop: int, period: int) -> np.ndarray:
    """Return the ticks of [first, stop) at which a message of this period is due, (n,) int64."""
    begin = -(-max(first, 0) // period) * period
    return np.arange(begin, stop, period, dtype=np.int64)


def to_record_batches(messages: Iterable[tuple[Topic, int, bytes]]) -> list[RecordBatch]:
    """Group messages (topic, tick, payload) into record batches of equal topic and length."""
    groups: dict[tuple[Topic, int], list[tuple[int, bytes]]] = {}
    for topic, tick, payload in messages:
        groups.setdefault((topic, len(payload)), []).append((tick, payload))
    result = []
    for (topic, size), group in groups.items():
        payloads = np.frombuffer(b"".join(payload for _, payload in group), np.uint8).reshape(-1, size)
        result.append(RecordBatch(topic, np.array([tick for tick, _ in group], np.int64), payloads))
    return result
