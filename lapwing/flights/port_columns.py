"""Messages of a topic as columns, directly from the rows of its port where these contain the fields."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from lapwing.cosim.diagram.block_diagram import BlockDiagram
from lapwing.cosim.diagram.topic_encoder import TopicEncoder, encode
from lapwing.kernels.row_packing import columns
from lapwing.messages.topic_columns import TopicColumns, history, history_of_batches
from lapwing.messages.topics import Topic, template_topic


def columns_of(
    diagram: BlockDiagram, only: Collection[Topic] | None = None
) -> Iterator[tuple[Topic, np.ndarray, Mapping[str, Any]]]:
    """Yield topic, times [ns] (n,) and columns of all messages of a finished block diagram.

    Args:
        diagram: block diagram with the full history of these topics.
        only: topics to yield, of every vehicle; None: all recorded ones.
    """
    interval = diagram.config.interval_ns
    for service in diagram.services:
        for encoder in service.encoders:
            if diagram.tick and (encoder.topic.recorded if only is None else template_topic(encoder.topic) in only):
                columns = PortColumns(diagram, encoder)
                yield encoder.topic, columns.ticks * interval, columns
        for topic in service.python_topics:
            messages = [(tick, payload) for of, tick, payload in service.messages if of is topic]
            if messages and (only is None or template_topic(topic) in only):
                ticks = np.array([tick for tick, _ in messages], np.int64)
                yield topic, ticks * interval, history(topic.message, [payload for _, payload in messages])


class PortColumns(Mapping[str, Any]):
    """Columns of a topic with the interface of `TopicColumns`; messages are encoded only on demand.

    Encoding takes half as long as the simulation, and studies of many flights only need numbers of the samples.
    """

    def __init__(self, diagram: BlockDiagram, encoder: TopicEncoder):
        """Create from a topic of a finished block diagram with the full history of its port."""
        self._diagram, self._encoder, self.message = diagram, encoder, encoder.topic.message
        period = diagram.ports[encoder.port].period
        rows = diagram.history(encoder.port, period)
        self.ticks = encoder.message_ticks(0, diagram.tick, lambda ticks: rows[ticks // period])
        self._rows = rows[:: encoder.period // period] if not encoder.on_change else rows[self.ticks]
        tree = columns(diagram.ports[encoder.port].example, self._rows)
        self._fields = encoder.fields(tree, self.ticks * diagram.config.interval_ns)
        self._texts = () if encoder.texts is None else encoder.texts(tree)
        first = tuple(int(column[0]) for column in self._texts)
        self._shapes = _shapes(encoder.topic.message, encoder.sample(*first).encode())
        self._columns: dict[str, np.ndarray] = {}

    @cached_property
    def _names(self) -> dict[str, None]:
        """Names of the fields that all messages have, whatever their texts."""
        keys = _distinct(self._texts) if self._texts else [()]
        shapes = [_shapes(self.message, self._encoder.sample(*key).encode()) for key in keys]
        return dict.fromkeys(name for name in shapes[0] if all(name in others for others in shapes))

    @cached_property
    def messages(self) -> TopicColumns:
        """Encoded messages."""
        port = self._diagram.ports[self._encoder.port]
        batches = list(encode(self._encoder, port, self._diagram.config, self.ticks, self._rows))
        parts = [(np.searchsorted(self.ticks, batch.ticks), batch.payloads) for batch in batches]
        return history_of_batches(self.message, parts)

    def payloads(self) -> list[bytes]:
        """Return the CDR of the messages in order."""
        return self.messages.payloads()

    def __getitem__(self, name: str) -> Any:
        if name not in self._fields:
            return self.messages[name]
        if name not in self._columns:
            (kind, shape), values = self._shapes[name], self._fields[name]
            column = np.asarray(values() if callable(values) else values).astype(kind, copy=False)
            self._columns[name] = np.broadcast_to(column, (len(self.ticks), *shape))
        return self._columns[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __contains__(self, name: object) -> bool:
        return name in self._shapes and (name in self._fields or name in self._names)

    def __len__(self) -> int:
        return len(self._names)

    def __reduce__(self) -> tuple[Any, ...]:
        return self.messages.__reduce__()


@lru_cache(maxsize=256)
def _shapes(message: Any, payload: bytes) -> dict[str, tuple[Any, tuple[int, ...]]]:
    """Return dtype and shape, without the time axis, of each field of a message; cached across flights."""
    result = {name: np.asarray(column) for name, column in history(message, [payload]).items()}
    return {name: (column.dtype, column.shape[1:]) for name, column in result.items()}


def _distinct(texts: Sequence[np.ndarray]) -> list[tuple[int, ...]]:
    """Return the distinct rows of integer columns that rarely change."""
    changed = np.zeros(len(texts[0]), bool)
    changed[0] = True
    for column in texts:
        changed[1:] |= column[1:] != column[:-1]
    rows = np.flatnonzero(changed)
    keys = np.stack([np.asarray(column[rows], np.int64) for column in texts], axis=1)
    return list(dict.fromkeys(map(tuple, keys.tolist())))
