"""Messages of a topic as columns, by dotted field name."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from lapwing.messages.cdr_arrays import number_fields, record_dtype
from lapwing.messages.cdr_layout import ENCAPSULATION, Layout

Column = np.ndarray | list[Any]

BATCH = 4096  # [messages] that are converted together


class _Group(NamedTuple):
    """Messages of one shape."""

    indices: np.ndarray  # indices among all messages, int64, shape (m,)
    layout: Layout
    records: np.ndarray  # shape (m,)


class TopicColumns(Mapping[str, Column]):
    """Columns of n messages; each is assembled when it is read.

    - A number: shape (n,). An array, a sequence of numbers, or a message within the message that holds float64 only:
      shape (n, k); a sequence whose length varies: object array of n arrays. A sequence of k such messages: (n, k, 3).
    - A string: list of n str. A sequence of strings: list of n tuples.
    - An element of a sequence has its number in the name: "pose.0.position".

    A field that some messages lack, for example "pose.2" if some have two poses, has no column.
    """

    def __init__(self, message: Any, groups: Sequence[_Group]) -> None:
        """Store messages of a class, grouped by shape; see `history` and `history_of_batches`."""
        self.message = message
        self.count = sum(len(group.indices) for group in groups)
        self._groups = groups
        tables = [_columns(group) for group in self._groups]
        self._names = [name for name in tables[0] if all(name in table for table in tables[1:])]
        self._partial = {name for table in tables for name in table}.difference(self._names)

    def __getitem__(self, name: str) -> Column:
        """Return a column.

        Raises:
            KeyError: the field is unknown.
            ValueError: it is not in every message, or a string is not UTF-8.
        """
        if name in self._partial:
            raise ValueError(f"{self.message.type_name}: field {name} is not in every message")
        if name not in self._names:
            raise KeyError(name)
        if name in number_fields(self._groups[0].records.dtype):
            return self._numbers(name)
        texts: list[Any] = [None] * self.count
        for group in self._groups:
            for index, text in zip(group.indices.tolist(), _texts(group, name), strict=True):
                texts[index] = text
        return texts

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __contains__(self, name: object) -> bool:
        return name in self._names

    def __len__(self) -> int:
        return len(self._names)

    def __reduce__(self) -> tuple[Any, ...]:
        return history, (self.message, self.payloads())

    def payloads(self) -> list[bytes]:
        """Return the messages in their order, as CDR."""
        result = [b""] * self.count
        for group in self._groups:
            for index, row in zip(group.indices.tolist(), _bytes(group.records), strict=True):
                result[index] = row.tobytes()
        return result

    def _numbers(self, name: str) -> np.ndarray:
        parts = [group.records[name] for group in self._groups]
        shapes = {part.shape[1:] for part in parts}
        shape = shapes.pop()
        if not shapes:
            column = np.empty((self.count, *shape), parts[0].dtype.newbyteorder("="))
            for group, part in zip(self._groups, parts, strict=True):
                column[group.indices] = part
            return column
        column = np.empty(self.count, object)
        for group, part in zip(self._groups, parts, strict=True):
            for index, value in zip(group.indices.tolist(), part.copy(), strict=True):
                column[index] = value
        return column


def history(message: Any, payloads: Sequence[bytes]) -> TopicColumns:
    """Return messages of one type as columns by dotted field name.

    Args:
        message: the message class.
        payloads: CDR, in the order of the columns; strings and sequences may differ in length.

    Raises:
        ValueError: a payload is not a message of the class.
    """
    return TopicColumns(message, list(_groups(message, payloads)))


class ColumnBuilder:
    """Builder of columns from single messages, batch by batch, so that at most one batch is in memory twice."""

    def __init__(self, message: Any) -> None:
        self._message, self._groups = message, list[_Group]()
        self._times: list[np.ndarray] = []
        self._pending: list[tuple[int, bytes]] = []
        self._count = 0

    def add(self, time_ns: int, payload: bytes) -> None:
        """Add an encoded message. Raise ValueError if a message of its batch is not one of the class."""
        self._pending.append((time_ns, payload))
        if len(self._pending) == BATCH:
            self._convert_batch()

    def history(self) -> tuple[np.ndarray, TopicColumns]:
        """Return times [ns], int64, shape (n,), and columns of all messages. See `history`."""
        if self._pending or not self._groups:
            self._convert_batch()
        return np.concatenate(self._times), TopicColumns(self._message, self._groups)

    def _convert_batch(self) -> None:
        times, payloads = zip(*self._pending, strict=True) if self._pending else ((), ())
        self._times.append(np.array(times, np.int64))
        self._groups += [
            group._replace(indices=group.indices + self._count) for group in _groups(self._message, payloads)
        ]
        self._count += len(times)
        self._pending.clear()


def history_of_batches(message: Any, batches: Sequence[tuple[np.ndarray, np.ndarray]]) -> TopicColumns:
    """Return messages as columns from record batches of one shape each.

    Args:
        message: the message class.
        batches: indices of the messages among all, shape (m,); their payloads, records or uint8 of shape (m, size).
    """
    groups = []
    for indices, payloads in batches:
        rows = payloads if payloads.dtype == np.uint8 else _bytes(payloads)
        layout = message.layouts.measure(rows[0].tobytes())
        groups.append(_Group(indices, layout, rows.view(record_dtype(layout)).reshape(len(rows))))
    return TopicColumns(message, groups or list(_groups(message, ())))


def _bytes(records: np.ndarray) -> np.ndarray:
    """Return records (m,) as uint8, shape (m, size)."""
    return records.view(np.uint8).reshape(len(records), records.dtype.itemsize)


def _groups(message: Any, payloads: Sequence[bytes]) -> Iterator[_Group]:
    """Yield the messages by shape. All payloads of a size are compared with one layout at once."""
    if not payloads:
        layout = message.layouts.measure(message().encode())
        yield _Group(np.empty(0, np.int64), layout, np.empty(0, record_dtype(layout)))
    sizes = np.fromiter(map(len, payloads), np.int64, len(payloads))
    for size in dict.fromkeys(sizes.tolist()):
        indices = np.flatnonzero(sizes == size)
        joined = b"".join(payloads if len(indices) == len(payloads) else [payloads[k] for k in indices.tolist()])
        rows = np.frombuffer(joined, np.uint8).reshape(len(indices), size)
        while len(indices):
            layout = message.layouts.measure(rows[0].tobytes())
            fits = _fits(layout, rows)
            fitting = rows if fits.all() else rows[fits]
            yield _Group(indices[fits], layout, fitting.view(record_dtype(layout)).reshape(len(fitting)))
            indices, rows = indices[~fits], rows[~fits]


def _fits(layout: Layout, rows: np.ndarray) -> np.ndarray:
    """Return a mask of the payloads of the layout's size, shape (m, size), that belong to it; see `Layout.fits`."""
    lengths = [(0, ENCAPSULATION), *((e.offset, e.length) for e in layout.entries if e.kind == "length")]
    result = np.ones(len(rows), bool)
    for offset, value in lengths:
        result &= np.ascontiguousarray(rows[:, offset : offset + 4]).view("<u4")[:, 0] == value
    return result


def _columns(group: _Group) -> dict[str, None]:
    """Return the names of all columns of a group, in order of the payload; numbers first."""
    texts = [e.name for e in group.layout.entries if e.kind == "string" or e.base == "string[]"]
    return dict.fromkeys([*number_fields(group.records.dtype), *texts])


def _texts(group: _Group, name: str) -> list[Any]:
    """Return a field's strings, or tuples of strings, of each message of a group."""
    result = {entry.name: entry for entry in group.layout.entries if entry.name == name}
    entry = result[name]  # the last entry of the name: a string follows its length
    if entry.kind == "length":
        elements = [_texts(group, f"{name}.{k}") for k in range(entry.length)]
        return list(zip(*elements, strict=True)) if elements else [()] * len(group.records)
    size = max(entry.length - 1, 0)
    if not size:
        return [""] * len(group.records)
    rows = _bytes(group.records)
    raw = np.ascontiguousarray(rows[:, entry.offset : entry.offset + size]).view(f"V{size}")[:, 0].tolist()
    try:
        decoded = {text: text.decode() for text in set(raw)}
    except UnicodeDecodeError as error:
        raise ValueError(f"field {name}: a string is not UTF-8: {error}") from None
    return [decoded[text] for text in raw]
