"""Conversion of port rows into messages: one topic encoder for each topic, in the services' `encoders.py`.

A batch of rows becomes a batch of payloads at once: `fields` returns the columns of the message's numbers, `sample` a
message that fixes its texts and the lengths of its sequences. Where texts change during a run, rows hold their numbers
in the service's table of texts, and a page falls into parts of the same texts.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.diagram.tick_schedule import Port
from lapwing.kernels.row_packing import columns
from lapwing.messages.cdr_arrays import Record
from lapwing.messages.topics import Topic

Fields = Mapping[str, Any]  # by field of the message a column (n,) or (n, k), a scalar, or a function that returns one


@dataclass(frozen=True)
class TopicEncoder:
    """Conversion of a port's rows into the messages of a topic.

    Attributes:
        topic: the topic.
        port: name of the port.
        period: ticks between two messages; a multiple of the port's.
        fields: (columns of the port's tree, instants [ns] (n,) of int64) to the message's fields.
        sample: a message with the texts of the given key; the key is () where `texts` is None.
        texts: the columns, each (n,), whose numbers choose the texts.
    """

    topic: Topic
    port: str
    period: int
    fields: Callable[[Any, np.ndarray], Fields]
    sample: Callable[..., Any]
    texts: Callable[[Any], Sequence[np.ndarray]] | None = None


class RecordBatch(NamedTuple):
    """Messages of one topic and of one shape."""

    topic: Topic
    ticks: np.ndarray  # (n,) int64
    payloads: np.ndarray  # (n,) records of the message


def encode(
    wire: TopicEncoder, port: Port, setup: RunConfig, ticks: np.ndarray, rows: np.ndarray
) -> Iterator[RecordBatch]:
    """Yield the messages of a topic at `ticks` (n,), from the rows (n, width) of its port at these ticks."""
    tree = columns(port.like, rows)
    if wire.texts is None:
        yield _page(wire, wire.sample(), tree, ticks, setup)
        return
    keys = np.stack([np.asarray(column, np.int64) for column in wire.texts(tree)], axis=1)
    for key in np.unique(keys, axis=0):
        chosen = np.flatnonzero((keys == key).all(axis=1))
        part = columns(port.like, rows[chosen]) if len(chosen) < len(ticks) else tree
        yield _page(wire, wire.sample(*key.tolist()), part, ticks[chosen], setup)


def _page(wire: TopicEncoder, sample: Any, tree: Any, ticks: np.ndarray, setup: RunConfig) -> RecordBatch:
    fields = wire.fields(tree, ticks * setup.interval_ns)
    return RecordBatch(wire.topic, ticks, Record.of(sample).encode(len(ticks), fields))


def due_ticks(first: int, stop: int, period: int) -> np.ndarray:
    """Return the ticks of [first, stop) at which a message of this period is due, (n,) int64."""
    begin = -(-max(first, 0) // period) * period
    return np.arange(begin, stop, period, dtype=np.int64)
