"""What services send one another: a bundle a tick, with the rows of all that a service gives at that tick; and batches
of encoded messages for those who record.

A bundle is the rows of the service's ports that are due at the tick, in the order of its set-up, one after the other:
little-endian float64, nothing between them. A service that gives nothing at a tick sends none. An empty bundle says
that there will be no other.

A batch is the tick before which all messages have been handed over (int64), then pages: length of the topic's
name (uint16), number of messages and size of a payload (uint32 each), the name, the ticks (int64 each), the payloads.
"""

import struct
from collections.abc import Iterable, Sequence

import numpy as np

from cosim.graph import Graph
from cosim.schedule import Port, due
from cosim.wire import Page
from dynamics.kernel import uncompiled
from dynamics.rows import width
from messages.topics import topic_named

_PAGE = struct.Struct("<HII")
_STOP = struct.Struct("<q")
_due = uncompiled(due)


class BundleError(ValueError):
    """Bytes that are no bundle or batch of this run."""


class Bundles:
    """The bundles of one service: which rows they hold at which tick."""

    def __init__(self, ports: Sequence[Port]):
        """Of a service that gives these ports, in their order."""
        self._ports = [(port.name, port.period, width(port.like)) for port in ports]

    def due(self, tick: int) -> bool:
        """Whether there is a bundle of this tick."""
        return any(_due(tick, period, 0) >= 0 for _, period, _ in self._ports)

    def pack(self, graph: Graph, tick: int) -> bytes:
        """The bundle of a tick, from the rows of a graph."""
        return b"".join(graph.row(name, tick).tobytes() for name, period, _ in self._ports if tick % period == 0)

    def unpack(self, payload: bytes, graph: Graph, tick: int) -> None:
        """Put the rows of a bundle into those of a graph that uses them.

        Raises:
            BundleError: it has not the size of this tick's.
        """
        due_now = [(name, columns) for name, period, columns in self._ports if tick % period == 0]
        expected = 8 * sum(columns for _, columns in due_now)
        if len(payload) != expected:
            raise BundleError(f"a bundle of {len(payload)} bytes at tick {tick}, expected {expected}")
        numbers = np.frombuffer(payload, "<f8")
        first = 0
        for name, columns in due_now:
            if graph.has(name):
                graph.put_row(name, tick, numbers[first : first + columns])
            first += columns


def pack_batch(pages: Iterable[Page], stop: int) -> bytes:
    """A batch of pages; all messages before the tick `stop` have been handed over with it."""
    parts = [_STOP.pack(stop)]
    for page in pages:
        payloads = np.ascontiguousarray(page.payloads)
        size = payloads.nbytes // len(page.ticks)
        name = page.topic.name.encode()
        parts += [_PAGE.pack(len(name), len(page.ticks), size), name, page.ticks.tobytes(), payloads.tobytes()]
    return b"".join(parts)


def unpack_batch(payload: bytes) -> tuple[int, list[Page]]:
    """The tick before which all has come, and the pages, payloads of shape (n, size).

    Raises:
        BundleError: no batch.
    """
    try:
        (stop,) = _STOP.unpack_from(payload)
        place, pages = _STOP.size, []
        while place < len(payload):
            length, n, size = _PAGE.unpack_from(payload, place)
            place += _PAGE.size
            topic = topic_named(payload[place : place + length].decode())
            place += length
            ticks = np.frombuffer(payload, "<i8", n, place)
            place += 8 * n
            payloads = np.frombuffer(payload, np.uint8, n * size, place).reshape(n, size)
            place += n * size
            pages.append(Page(topic, ticks, payloads))
        return stop, pages
    except (struct.error, ValueError, IndexError) as error:
        raise BundleError(f"a batch of {len(payload)} bytes: {error}") from None
