"""Rows of the ports of a block diagram: ring buffers that are read and written by tick."""

from collections.abc import Callable, Mapping
from typing import Any, TypeVar

import numpy as np

from lapwing.cosim.diagram.tick_schedule import LATCHED, Port
from lapwing.kernels.row_packing import pack_row, row_unpacker, row_width

T = TypeVar("T")
SPARE = 8  # rows of a port in addition to those of a tick block


class PortRows:
    """Ring buffers of ports.

    Attributes:
        ports: all ports of the run by name.
    """

    def __init__(
        self,
        ports: dict[str, Port],
        depths: Mapping[str, int],
        delays: Mapping[str, int],
        rows: dict[str, np.ndarray] | None,
    ):
        """Allocate the rows of the ports in `depths`.

        Args:
            ports: all ports of the run by name.
            depths: number of ticks to keep, by port.
            delays: largest delay of the inputs that read a port, by port [ticks].
            rows: rows that are no longer needed; their memory is reused if the shape is equal.
        """
        self.ports = ports
        self._rows = {} if rows is None else rows
        for name in sorted(depths):
            self._rows[name] = _ring(ports[name], depths[name], delays.get(name, 0), self._rows.get(name))
        self._readers: dict[str, Callable[[np.ndarray], Any]] = {}  # by port

    def has(self, port: str) -> bool:
        """Return True if a block of this diagram reads or writes the port."""
        return port in self._rows

    def latest(self, port: str, tick: int) -> Any:
        """Return the value of a port at the last tick up to `tick` at which one was due."""
        period = max(1, self.ports[port].period)
        if port not in self._readers:
            self._readers[port] = row_unpacker(self.ports[port].example)
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

    def _index(self, port: str, ticks: Any) -> Any:
        period = self.ports[port].period
        return 0 if period == LATCHED else (ticks // period) & (len(self._rows[port]) - 1)


class RenamedPortRows(PortRows):
    """View of the rows of ports under other names."""

    def __init__(self, rows: PortRows, name_of: Callable[[str], str]):
        """Create a view of `rows`; `name_of` returns the name there of a port of the view."""
        self.ports, self._rows = _RenamedItems(rows.ports, name_of), _RenamedItems(rows._rows, name_of)
        self._readers = {}


class _RenamedItems(dict[str, T]):
    """Items of a dict under other names, which are translated at their first use."""

    def __init__(self, items: dict[str, T], name_of: Callable[[str], str]):
        super().__init__()
        self._items, self._name_of = items, name_of

    def __contains__(self, name: object) -> bool:
        return isinstance(name, str) and self._name_of(name) in self._items

    def __missing__(self, name: str) -> T:
        item = self[name] = self._items[self._name_of(name)]
        return item


def _ring(port: Port, ticks: int, delay: int, former: np.ndarray | None) -> np.ndarray:
    """Return rows for `ticks` ticks, in the memory of `former` if it has the same shape."""
    rows = 1 if port.period == LATCHED else -(-ticks // port.period) + SPARE
    shape = 1 << (rows - 1).bit_length(), max(1, row_width(port.example))
    if former is None or former.shape != shape:
        return np.zeros(shape)
    former[: SPARE + delay] = former[-SPARE - delay :] = 0.0  # rows of ticks before 0 are read before they are written
    return former
