"""The messages of a topic as columns, straight from the rows of its port, as far as these have them."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from cosim.graph import Graph
from cosim.wire import Wire, due_ticks, encode
from dynamics.rows import columns
from messages.history import History, history, history_of_pages
from messages.topics import Topic, of_all


def columns_of(
    graph: Graph, only: Collection[Topic] | None = None
) -> Iterator[tuple[Topic, np.ndarray, Mapping[str, Any]]]:
    """Topic, times [ns] (n,) and columns of all that was said in a graph that has come to its end.

    Args:
        graph: has kept all rows of what these topics are made of.
        only: the topics wanted, of every vehicle, None for all that are recorded.
    """
    interval = graph.setup.interval_ns
    for service in graph.services:
        for wire in service.wires:
            if graph.tick and (wire.topic.recorded if only is None else of_all(wire.topic) in only):
                columns = PortColumns(graph, wire)
                yield wire.topic, columns.ticks * interval, columns
        for topic in service.spoken:
            said = [(tick, payload) for of, tick, payload in service.messages if of is topic]
            if said and (only is None or of_all(topic) in only):
                ticks = np.array([tick for tick, _ in said], np.int64)
                yield topic, ticks * interval, history(topic.message, [payload for _, payload in said])


class PortColumns(Mapping[str, Any]):
    """The same mapping as the `History` of the topic's messages, which are encoded only when that is asked for more.

    Encoding takes half as long as flying; who looks at many flights wants numbers that stand in the rows anyhow.
    """

    def __init__(self, graph: Graph, wire: Wire):
        """Of a topic of a graph that has come to its end and has kept all rows of its port."""
        self._graph, self._wire = graph, wire
        self.ticks = due_ticks(0, graph.tick, wire.period)
        self._rows = graph.all_rows(wire.port, wire.period)
        tree = columns(graph.ports[wire.port].like, self._rows)
        self._fields = wire.fields(tree, self.ticks * graph.setup.interval_ns)
        # one message with each of the texts that occur: names, types and shapes of all columns
        keys = [()] if wire.texts is None else _distinct(wire.texts(tree))
        self._samples = _samples(wire.topic.message, *(wire.sample(*key).encode() for key in keys))
        self._columns: dict[str, np.ndarray] = {}

    @cached_property
    def messages(self) -> History:
        """The encoded messages."""
        port = self._graph.ports[self._wire.port]
        pages = list(encode(self._wire, port, self._graph.setup, self.ticks, self._rows))
        places = [np.searchsorted(self.ticks, page.ticks) for page in pages]
        parts = [(place, page.payloads) for place, page in zip(places, pages, strict=True)]
        return history_of_pages(self._wire.topic.message, parts)

    def payloads(self) -> list[bytes]:
        """The messages in their order, as CDR."""
        return self.messages.payloads()

    def __getitem__(self, name: str) -> Any:
        if name not in self._fields:
            return self.messages[name]
        if name not in self._columns:
            like = self._samples[name]
            assert isinstance(like, np.ndarray)  # a number
            column = np.asarray(self._fields[name]).astype(like.dtype, copy=False)
            self._columns[name] = np.broadcast_to(column, (len(self.ticks), *like.shape[1:]))
        return self._columns[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._samples)

    def __contains__(self, name: object) -> bool:
        return name in self._samples

    def __len__(self) -> int:
        return len(self._samples)

    def __reduce__(self) -> tuple[Any, ...]:
        return self.messages.__reduce__()


@lru_cache(maxsize=64)
def _samples(message: Any, *payloads: bytes) -> History:
    """The history of some messages; the flights of a campaign share theirs."""
    return history(message, payloads)


def _distinct(texts: Sequence[np.ndarray]) -> list[tuple[int, ...]]:
    """The different rows of some columns of whole numbers that change seldom."""
    changed = np.zeros(len(texts[0]), bool)
    changed[0] = True
    for column in texts:
        changed[1:] |= column[1:] != column[:-1]
    at = np.flatnonzero(changed)
    keys = np.stack([np.asarray(column[at], np.int64) for column in texts], axis=1)
    return list(dict.fromkeys(map(tuple, keys.tolist())))
