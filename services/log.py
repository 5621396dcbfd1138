"""MCAP logs: written during a run, read by replay and report. The only file that imports mcap.

Schemas are `ros2msg`, payloads `cdr`, log time and publish time are simulation time. The file grows by whole chunks,
at least every 0.5 s of wall time; a log whose writer was killed is readable up to its last chunk.
"""

import io
import mimetypes
import os
import struct
import time
from bisect import bisect_right
from collections.abc import Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from operator import itemgetter
from pathlib import Path
from typing import Any, NamedTuple, Self

from mcap import records
from mcap.data_stream import ReadDataStream, RecordBuilder
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.stream_reader import get_chunk_data_stream
from mcap.writer import MCAP0_MAGIC, CompressionType, Writer

from messages import message_class
from messages.digest import Digest

METADATA = "lapwing"  # name of the metadata record
DETERMINISTIC = "deterministic"  # key in a channel's metadata: "true" or "false"
CHUNK_SIZE = 512 * 1024  # [bytes], uncompressed
FLUSH_PERIOD = 0.5  # [s] of wall time

_RECORD = struct.Struct("<BQ")  # opcode, length of what follows
_MESSAGE = struct.Struct("<HIQQ")  # channel, sequence, log time, publish time; then the payload
_MESSAGE_RECORD = struct.Struct("<BQHIQQ")
_TIMES = struct.Struct("<QQ")
_FOREVER = 1 << 64
_time = itemgetter(0)
_DECLARATIONS: dict[int, Any] = {
    Opcode.SCHEMA: records.Schema,
    Opcode.CHANNEL: records.Channel,
    Opcode.METADATA: records.Metadata,
    Opcode.ATTACHMENT: records.Attachment,
}


class _ChunkPlace(NamedTuple):
    """Where a chunk is, and the times of its first and last message."""

    offset: int  # [bytes]
    start_ns: int
    end_ns: int


class _Channel:
    """A topic being written."""

    def __init__(self, topic: str, message: Any, deterministic: bool) -> None:
        self.topic = topic
        self.message = message
        self.deterministic = deterministic
        self.id = 0  # given when its first chunk is built
        self.sequence = 0


_Entry = tuple[_Channel, int, bytes]  # channel, time [ns], payload


class _PackedIndex(records.MessageIndex):
    """A message index written in one go, its `records` a flat list; the library packs number by number."""

    def write(self, stream: RecordBuilder) -> None:
        count = len(self.records)
        layout = f"<BQHI{count}Q"
        stream.write(
            struct.pack(layout, Opcode.MESSAGE_INDEX, 6 + 8 * count, self.channel_id, 8 * count, *self.records)
        )


def _fill_chunk(writer: Writer, entries: list[_Entry]) -> None:
    """Put messages into the library's chunk builder, and count them in its statistics.

    Its own `add_message` costs 4 us a message. This reaches into two private members of mcap's Writer, only here.
    """
    builder = writer._Writer__chunk_builder  # type: ignore[attr-defined]
    statistics = writer._Writer__statistics  # type: ignore[attr-defined]
    offset = builder.count
    data: list[bytes] = []
    index: dict[int, list[int]] = {}  # by channel: time and offset of each message, alternating
    for channel, time_ns, payload in entries:
        length = len(payload) + _MESSAGE.size
        data += (_MESSAGE_RECORD.pack(5, length, channel.id, channel.sequence, time_ns, time_ns), payload)
        channel.sequence += 1
        if channel.id not in index:
            index[channel.id] = []
        index[channel.id] += (time_ns, offset)
        offset += length + _RECORD.size
    for channel_id, places in index.items():
        builder.message_indices[channel_id] = _PackedIndex(channel_id, places)  # type: ignore[arg-type]
        statistics.channel_message_counts[channel_id] += len(places) // 2
    times = [time_ns for _, time_ns, _ in entries]
    start, end = min(times), max(times)
    builder.record_writer.write(b"".join(data))
    builder.num_messages = len(entries)
    builder.message_start_time, builder.message_end_time = start, end
    statistics.message_start_time = min(start, statistics.message_start_time) if statistics.message_count else start
    statistics.message_end_time = max(end, statistics.message_end_time)
    statistics.message_count += len(entries)


class LogWriter:
    """Writes one log; a context manager. `write` collects, a thread of its own hashes, compresses and writes chunks.

    Args:
        path: the file; overwritten.
        metadata: goes into the record `lapwing`, at the start, and again at the end with the key `digest`; the
            attribute `metadata` may be added to in between.
        attachments: file name to contents.

    Raises:
        ValueError: the file cannot be written (also from `write`, `flush` and `close`).
    """

    def __init__(self, path: str | Path, metadata: dict[str, str], attachments: dict[str, bytes]) -> None:
        self.path = Path(path)
        self.metadata = dict(metadata)
        self._digest = Digest()
        self._channels: dict[str, _Channel] = {}
        self._schemas: dict[str, int] = {}
        self._entries: list[_Entry] = []
        self._size = 0
        self._pending: Future | None = None
        try:
            self._file = open(self.path, "wb")  # noqa: SIM115 (closed in close)
        except OSError as fault:
            raise self._error(fault) from None
        self._writer = Writer(self._file, chunk_size=1 << 62, compression=CompressionType.ZSTD)  # chunks are cut here
        self._writer.start(profile="ros2", library="lapwing")
        self._writer.add_metadata(METADATA, self.metadata)
        for name, data in attachments.items():
            kind = mimetypes.guess_type(name)[0] or "application/octet-stream"
            self._writer.add_attachment(0, 0, name, kind, data)
        self._worker = ThreadPoolExecutor(max_workers=1, thread_name_prefix="log")
        self._due = time.monotonic()  # the first message makes a chunk of its own: even a short log is readable

    def write(self, topic: str, message: Any, payload: bytes, time_ns: int, deterministic: bool = True) -> None:
        """Record one message.

        Args:
            topic: "/drone1/imu".
            message: message class, or full name of the type.
            payload: the encoded message.
            time_ns: simulation time [ns], not negative.
            deterministic: whether it enters the digest.
        """
        channel = self._channels.get(topic)
        if channel is None:
            cls = message_class(message) if isinstance(message, str) else message
            channel = self._channels[topic] = _Channel(topic, cls, deterministic)
        self._entries.append((channel, time_ns, payload))
        self._size += len(payload)
        if self._size >= CHUNK_SIZE or time.monotonic() >= self._due:
            self._cut()

    def flush(self) -> None:
        """Bring everything written so far into the file. `write` does it every 0.5 s; call this when none comes."""
        self._cut()
        self._wait()

    @property
    def digest(self) -> str:
        """Digest of the deterministic messages so far (hex)."""
        self.flush()
        return self._digest.hexdigest()

    def close(self) -> None:
        """Write what is left, the metadata with the digest, and the summary; close the file."""
        if self._file.closed:
            return
        try:
            try:
                self.metadata["digest"] = self.digest
                self._writer.add_metadata(METADATA, self.metadata)
                self._writer.finish()
            finally:
                self._worker.shutdown()
                self._file.close()
        except OSError as fault:
            raise self._error(fault) from None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _cut(self) -> None:
        """Give the collected messages to the worker, once it has finished the chunk before."""
        entries, self._entries, self._size = self._entries, [], 0
        self._due = time.monotonic() + FLUSH_PERIOD
        if entries:
            self._wait()
            self._pending = self._worker.submit(self._write_chunk, entries)

    def _wait(self) -> None:
        pending, self._pending = self._pending, None
        if pending is not None:
            try:
                pending.result()
            except OSError as fault:
                raise self._error(fault) from None

    def _write_chunk(self, entries: list[_Entry]) -> None:
        for channel in dict.fromkeys(channel for channel, _, _ in entries):
            if not channel.id:
                self._register(channel)
        for channel, time_ns, payload in entries:
            if channel.deterministic:
                self._digest.update(channel.topic, time_ns, payload)
        _fill_chunk(self._writer, entries)
        self._writer.flush()

    def _register(self, channel: _Channel) -> None:
        message = channel.message
        if message.type_name not in self._schemas:
            text = message.schema_text.encode()
            self._schemas[message.type_name] = self._writer.register_schema(message.type_name, "ros2msg", text)
        flag = {DETERMINISTIC: "true" if channel.deterministic else "false"}
        schema = self._schemas[message.type_name]
        channel.id = self._writer.register_channel(channel.topic, "cdr", schema, flag)

    def _error(self, fault: OSError) -> ValueError:
        return ValueError(f"{self.path}: cannot write the log: {fault.strerror or fault}")


class LogReader:
    """Reads one log, also one whose writer was killed; a context manager.

    Attributes:
        metadata: of the record `lapwing`; empty in other tools' logs.
        attachments: file name to contents.
        complete: False if the file has no end (its writer was killed); it then ends with its last whole chunk.

    Raises:
        ValueError: the file is missing or no MCAP file; from `messages` and `digest`, also if a chunk is damaged.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        self.metadata: dict[str, str] = {}
        self.attachments: dict[str, bytes] = {}
        self.complete = False
        self._schemas: dict[int, str] = {}
        self._channels: dict[int, records.Channel] = {}
        self._chunks: list[_ChunkPlace] = []
        try:
            self._file = open(self.path, "rb")  # noqa: SIM115 (closed in close)
        except OSError as fault:
            raise ValueError(f"{self.path}: cannot read the log: {fault.strerror}") from None
        try:
            self._scan()
        except BaseException:
            self._file.close()
            raise

    def topics(self) -> dict[str, str]:
        """Full type name of each topic, in order of the topics' names."""
        return {c.topic: self._schemas[c.schema_id] for c in sorted(self._channels.values(), key=lambda c: c.topic)}

    def messages(
        self, topics: Iterable[str] | None = None, start_ns: int | None = None, end_ns: int | None = None
    ) -> Iterator[tuple[str, str, int, bytes]]:
        """Messages in order of time, and of writing within the same time.

        Args:
            topics: only these; None: all.
            start_ns: the first instant [ns]; None: the log's.
            end_ns: the first instant left out [ns]; None: to the end.

        Yields:
            topic, full type name, simulation time [ns], payload.

        Raises:
            ValueError: the log has no such topic, or a chunk is damaged.
        """
        names = self.topics()
        wanted = set(names if topics is None else topics)
        if wanted - set(names):
            missing = ", ".join(sorted(wanted - set(names)))
            raise ValueError(f"{self.path}: the log has no topic {missing}; it has {', '.join(names)}")
        labels = {i: (c.topic, names[c.topic]) for i, c in self._channels.items() if c.topic in wanted}
        first, last = start_ns or 0, _FOREVER if end_ns is None else end_ns
        chunks = [chunk for chunk in self._chunks if chunk.end_ns >= first and chunk.start_ns < last]
        horizons = [_FOREVER]  # earliest time in all the chunks that follow
        for chunk in reversed(chunks[1:]):
            horizons.append(min(horizons[-1], chunk.start_ns))
        waiting: list[tuple[int, int, bytes]] = []
        for chunk in chunks:
            waiting += (m for m in self._read_chunk(chunk.offset) if m[1] in labels and first <= m[0] < last)
            waiting.sort(key=_time)  # stable: equal times keep the order of writing
            ready = bisect_right(waiting, horizons.pop(), key=_time)
            for time_ns, channel_id, payload in waiting[:ready]:
                yield *labels[channel_id], time_ns, payload
            del waiting[:ready]

    def deterministic_topics(self) -> set[str]:
        """The topics that enter the digest."""
        return {c.topic for c in self._channels.values() if c.metadata.get(DETERMINISTIC) != "false"}

    def digest(self) -> str:
        """Digest of the deterministic messages, computed anew; equals `metadata["digest"]` of an intact log."""
        digest = Digest()
        for topic, _, time_ns, payload in self.messages(self.deterministic_topics()):
            digest.update(topic, time_ns, payload)
        return digest.hexdigest()

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _scan(self) -> None:
        """Walk over the records, noting where the chunks are without reading them."""
        file = self._file
        size = os.fstat(file.fileno()).st_size
        if file.read(len(MCAP0_MAGIC)) != MCAP0_MAGIC:
            raise ValueError(f"{self.path}: not an MCAP file")
        offset = len(MCAP0_MAGIC)
        while offset + _RECORD.size <= size:
            opcode, length = _RECORD.unpack(file.read(_RECORD.size))
            if opcode == 0 or offset + _RECORD.size + length > size:
                break  # a record that was never finished
            if opcode == Opcode.FOOTER:
                self.complete = True
                break
            if opcode == Opcode.CHUNK:
                self._chunks.append(_ChunkPlace(offset, *_TIMES.unpack(file.read(_TIMES.size))))
            elif opcode == Opcode.MESSAGE:
                raise ValueError(f"{self.path}: holds messages outside of chunks, expected a chunked log")
            elif opcode in _DECLARATIONS:
                self._declare(opcode, file.read(length))
            offset += _RECORD.size + length
            file.seek(offset)
        if not (self.complete and self._channels):
            for chunk in self._chunks:
                self._read_chunk(chunk.offset)

    def _declare(self, opcode: int, data: bytes) -> None:
        try:
            record = _DECLARATIONS[opcode].read(ReadDataStream(io.BytesIO(data)))
        except (McapError, struct.error, UnicodeDecodeError) as fault:
            raise ValueError(f"{self.path}: damaged {Opcode(opcode).name.lower()} record: {fault}") from None
        if isinstance(record, records.Schema):
            self._schemas[record.id] = record.name
        elif isinstance(record, records.Channel):
            self._schemas.setdefault(record.schema_id, "")
            self._channels[record.id] = record
        elif isinstance(record, records.Attachment):
            self.attachments[record.name] = record.data
        elif record.name == METADATA:
            self.metadata = record.metadata

    def _read_chunk(self, offset: int) -> list[tuple[int, int, bytes]]:
        """Time, channel and payload of a chunk's messages, in order of writing."""
        self._file.seek(offset + _RECORD.size)
        try:
            chunk = records.Chunk.read(ReadDataStream(self._file))
            stream, size = get_chunk_data_stream(chunk, validate_crc=True)
            data = stream.read(size)
        except Exception as fault:  # whatever the decompressor raises
            raise ValueError(f"{self.path}: damaged chunk at byte {offset}: {fault}") from None
        found = []
        place = 0
        while place < size:
            opcode, length = _RECORD.unpack_from(data, place)
            place += _RECORD.size
            if opcode == Opcode.MESSAGE:
                channel, _, time_ns, _ = _MESSAGE.unpack_from(data, place)
                found.append((time_ns, channel, data[place + _MESSAGE.size : place + length]))
            elif opcode in _DECLARATIONS:
                self._declare(opcode, data[place : place + length])
            place += length
        return found
