"""Messages of a chunk: conversion of columns to ordered MCAP message records, and the chunks' indexes."""

import struct
from functools import cache
from pathlib import Path
from tempfile import SpooledTemporaryFile
from typing import NamedTuple

import numpy as np
from mcap.opcode import Opcode

from lapwing.messages.digest import Digest

IN_MEMORY = 1 << 16  # [bytes] about 170 chunks and as many wall times


class Extent(NamedTuple):
    """Number of valid chunk indexes, bytes of their records, and times of the first and last message."""

    chunks: int = 0
    size: int = 0  # [bytes]
    start_ns: int | None = None
    end_ns: int = 0


class ChunkIndexes:
    """Encoded records of kind CHUNK_INDEX. A flight of days has hundreds of thousands, which take 2 kB each as objects.

    Attributes:
        extent: valid indexes; set it to an earlier value to remove the indexes that were added since.
    """

    def __init__(self, folder: Path) -> None:
        """Create an empty list; large lists are in an unnamed file in `folder`, the log's."""
        self.extent = Extent()
        self._file = SpooledTemporaryFile(IN_MEMORY, dir=str(folder), prefix="lapwing-")  # noqa: SIM115 (closed in close)

    def add(self, record: bytes, start_ns: int, end_ns: int) -> None:
        """Add the index of a chunk with messages of these times [ns].

        Raises:
            OSError: it cannot be written; the index is then not added.
        """
        chunks, size, first_ns, last_ns = self.extent
        self._file.seek(size)
        self._file.write(record)
        first_ns = start_ns if first_ns is None else min(first_ns, start_ns)
        self.extent = Extent(chunks + 1, size + len(record), first_ns, max(last_ns, end_ns))

    def records(self) -> bytes:
        """Return all valid indexes in order. Raise OSError if they cannot be read."""
        self._file.seek(0)
        return self._file.read(self.extent.size)

    def close(self) -> None:
        """Delete the indexes."""
        self._file.close()


_INDEX = struct.Struct("<BQHI")  # opcode, length of the remaining record, channel, length of the entries


class WrittenTopic:
    """Topic of a log in progress."""

    def __init__(self, name: str, channel_id: int, deterministic: bool) -> None:
        self.name = name
        self.channel_id = channel_id
        self.deterministic = deterministic  # True if it is part of the digest
        self.count = 0  # number of messages so far


class Rows(NamedTuple):
    """n messages of equal size of a topic."""

    topic: WrittenTopic
    records: np.ndarray  # MCAP message records, shape (n,); their sequence numbers are filled in later
    order: np.ndarray  # int64, shape (n,): ascending sort keys within a chunk


class Index(NamedTuple):
    """Times and positions of the messages of a channel."""

    channel_id: int
    times_ns: np.ndarray  # int64, shape (n,)
    offsets: np.ndarray  # [bytes] from the first message of the chunk, int64, shape (n,)

    def record(self, shift: int) -> bytes:
        """Return the MCAP message index record, with offsets increased by `shift` [bytes]."""
        entries = np.column_stack([self.times_ns, self.offsets + shift]).astype("<u8").tobytes()
        return _INDEX.pack(Opcode.MESSAGE_INDEX, 6 + len(entries), self.channel_id, len(entries)) + entries


class Messages(NamedTuple):
    """Messages of a chunk in MCAP format."""

    data: bytes
    indexes: list[Index]  # index of each channel
    start_ns: int
    end_ns: int


def rows(topic: WrittenTopic, times_ns: np.ndarray, payloads: np.ndarray, order: np.ndarray) -> Rows:
    """Copy messages into MCAP message records.

    Args:
        topic: topic of the messages.
        times_ns: simulation times [ns], shape (n,).
        payloads: uint8, shape (n, size).
        order: sort keys of the messages within the chunk, shape (n,).
    """
    n, size = payloads.shape
    records = np.empty(n, _record_dtype(size))
    records["opcode"] = Opcode.MESSAGE
    records["length"] = records.itemsize - 9  # length without opcode and length field
    records["channel"] = topic.channel_id
    records["log_time"] = records["publish_time"] = times_ns
    records["payload"] = payloads
    return Rows(topic, records, order)


def rows_of(entries: list[tuple[WrittenTopic, int, bytes]]) -> list[Rows]:
    """Return rows of single messages (topic, time [ns], payload): one `Rows` for each topic and size."""
    groups: dict[tuple[WrittenTopic, int], list[int]] = {}
    for k, (topic, _, payload) in enumerate(entries):
        groups.setdefault((topic, len(payload)), []).append(k)
    result = []
    for (topic, size), places in groups.items():
        payloads = np.frombuffer(b"".join([entries[k][2] for k in places]), np.uint8).reshape(len(places), size)
        result.append(rows(topic, np.array([entries[k][1] for k in places]), payloads, np.array(places)))
    return result


def add_to_digest(digest: Digest, parts: list[Rows]) -> None:
    """Add the messages of deterministic topics, those of each topic in order."""
    for topic, of_topic in _by_topic(parts).items():
        if not topic.deterministic:
            continue
        if len({part.records.itemsize for part in of_topic}) == 1:
            order = np.concatenate([part.order for part in of_topic])
            records = np.concatenate([part.records for part in of_topic])[np.argsort(order, kind="stable")]
            digest.update_batch(topic.name, records["log_time"].astype(np.int64), records["payload"])
            continue
        entries: list[tuple[int, int, bytes]] = []
        for part, places in zip(of_topic, _places(of_topic), strict=True):
            payloads = [payload.tobytes() for payload in part.records["payload"]]
            entries += zip(places.tolist(), part.records["log_time"].tolist(), payloads, strict=True)
        for _, time_ns, payload in sorted(entries):
            digest.update(topic.name, time_ns, payload)


def arrange(parts: list[Rows]) -> Messages:
    """Number the messages of each topic, and arrange all messages in ascending order.

    Args:
        parts: at least one message; for equal sort keys, the earlier part is first.
    """
    for topic, of_topic in _by_topic(parts).items():
        for part, places in zip(of_topic, _places(of_topic), strict=True):
            part.records["sequence"] = topic.count + places
        topic.count += sum(len(part.records) for part in of_topic)
    all_places = _places(parts)
    sizes = np.empty(sum(map(len, all_places)), np.int64)
    for part, places in zip(parts, all_places, strict=True):
        sizes[places] = part.records.itemsize
    ends = np.cumsum(sizes)
    data = np.empty(ends[-1], np.uint8)
    result: dict[int, list[tuple[np.ndarray, np.ndarray]]] = {}
    for part, places in zip(parts, all_places, strict=True):
        size = part.records.itemsize
        offsets = ends[places] - size
        # A view of `data` with an element of this size at every byte, so that one assignment copies all records.
        windows = np.ndarray((len(data) - size + 1,), f"V{size}", data, strides=(1,))
        windows[offsets] = part.records.view(f"V{size}")
        times_ns = part.records["log_time"].astype(np.int64)
        result.setdefault(part.topic.channel_id, []).append((times_ns, offsets))
    indexes = []
    for channel_id, pieces in result.items():
        times, starts = (np.concatenate(column) for column in zip(*pieces, strict=True))
        by_offset = np.argsort(starts)
        indexes.append(Index(channel_id, times[by_offset], starts[by_offset]))
    start = min(int(index.times_ns.min()) for index in indexes)
    end = max(int(index.times_ns.max()) for index in indexes)
    return Messages(data.tobytes(), indexes, start, end)


@cache
def _record_dtype(size: int) -> np.dtype:
    """Return the layout of an MCAP message record with a payload of this size."""
    numbers = [("opcode", "u1"), ("length", "<u8"), ("channel", "<u2"), ("sequence", "<u4")]
    return np.dtype([*numbers, ("log_time", "<u8"), ("publish_time", "<u8"), ("payload", "u1", (size,))])


def _by_topic(parts: list[Rows]) -> dict[WrittenTopic, list[Rows]]:
    result: dict[WrittenTopic, list[Rows]] = {}
    for part in parts:
        result.setdefault(part.topic, []).append(part)
    return result


def _places(parts: list[Rows]) -> list[np.ndarray]:
    """Return the position of every message among all parts, by part."""
    order = np.concatenate([part.order for part in parts])
    places = np.empty(len(order), np.int64)
    places[np.argsort(order, kind="stable")] = np.arange(len(order))
    return np.split(places, np.cumsum([len(part.order) for part in parts])[:-1])
