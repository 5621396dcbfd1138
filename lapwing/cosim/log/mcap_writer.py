"""Writer of MCAP files: records in order, and the index at the end."""

import errno
import mimetypes
import os
import resource
import zlib
from collections.abc import Sequence
from contextlib import suppress
from io import FileIO
from pathlib import Path
from typing import Self

import zstandard
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    McapRecord,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)
from mcap.summary import Summary
from mcap.writer import MCAP0_MAGIC

from lapwing.cosim.log.chunk import ChunkIndexes, Messages

METADATA = "lapwing"  # name of the metadata record at the start
METADATA_END = "lapwing_end"  # name of the metadata record at the end, with entries that were not known at the start
DETERMINISTIC = "deterministic"  # key in a channel's metadata: "true" or "false"
COMPRESSION_LEVEL = 2  # zstd: the default level 3 gives larger logs; level 9 saves 3 % for five times the work
SMALL = 1024  # [bytes] size below which messages are not compressed
END = 1 << 15  # [bytes] more than metadata, statistics and footer at the end need
_CRC = 4  # [bytes] size of the footer's checksum, which does not cover these bytes


class Container:
    """Writer of a file's records and of their index. All methods may raise OSError."""

    def __init__(self, file: FileIO) -> None:
        """Start a file that is empty, unbuffered and open for writing."""
        self._begin(file)
        self._write(MCAP0_MAGIC)
        self._write(encode(Header(profile="ros2", library="lapwing")))

    @classmethod
    def resume(cls, file: FileIO, summary: Summary, offset: int) -> Self:
        """Continue a finished file at `offset` [bytes], the position of its DATA_END record."""
        self = cls.__new__(cls)
        self._begin(file)
        self._offset = offset
        self._schemas, self._channels = list(summary.schemas.values()), list(summary.channels.values())
        for index in summary.chunk_indexes:
            self._chunks.add(encode(index), index.message_start_time, index.message_end_time)
        self._attachments, self._metadata = summary.attachment_indexes, summary.metadata_indexes
        self._counts = dict(summary.statistics.channel_message_counts) if summary.statistics else {}
        file.seek(offset)
        return self

    def _begin(self, file: FileIO) -> None:
        self._file = file
        self._offset = 0
        self._compressor = zstandard.ZstdCompressor(level=COMPRESSION_LEVEL)
        self._schemas: list[Schema] = []
        self._channels: list[Channel] = []
        self._chunks = ChunkIndexes(Path(file.name).parent)
        self._attachments: list[AttachmentIndex] = []
        self._metadata: list[MetadataIndex] = []
        self._counts: dict[int, int] = {}  # messages by channel
        self._declared = 0  # [bytes] of all schemas and channels

    def add_attachment(self, name: str, data: bytes) -> None:
        """Write an attachment; its media type follows from the file name."""
        kind = mimetypes.guess_type(name)[0] or "application/octet-stream"
        record = encode(Attachment(create_time=0, log_time=0, name=name, media_type=kind, data=data))
        self._attachments.append(
            AttachmentIndex(
                offset=self._offset,
                length=len(record),
                log_time=0,
                create_time=0,
                data_size=len(data),
                name=name,
                media_type=kind,
            )
        )
        self._write(record)

    def add_metadata(self, name: str, metadata: dict[str, str]) -> None:
        """Write a metadata record."""
        record = encode(Metadata(metadata=metadata, name=name))
        self._metadata.append(MetadataIndex(length=len(record), name=name, offset=self._offset))
        self._write(record)

    def add_chunk(self, declarations: list[Schema | Channel], messages: Messages) -> None:
        """Write a compressed chunk with the index of its messages.

        Args:
            declarations: schemas and channels that no earlier chunk has declared; they are written into this one.
            messages: at least one message.
        """
        head = b"".join(map(encode, declarations))
        data = head + messages.data
        is_small = len(messages.data) < SMALL
        stored = data if is_small else self._compressor.compress(data)
        chunk = Chunk(
            compression="" if is_small else "zstd",
            data=stored,
            message_start_time=messages.start_ns,
            message_end_time=messages.end_ns,
            uncompressed_crc=zlib.crc32(data),
            uncompressed_size=len(data),
        )
        records = [encode(chunk)]
        offset = end = self._offset
        length = len(records[0])
        index_offsets: dict[int, int] = {}
        for entry in messages.indexes:
            end += len(records[-1])
            index_offsets[entry.channel_id] = end
            records.append(entry.record(len(head)))
        record = b"".join(records)
        index = ChunkIndex(
            chunk_start_offset=offset,
            chunk_length=length,
            compression=chunk.compression,
            compressed_size=len(stored),
            uncompressed_size=len(data),
            message_start_time=messages.start_ns,
            message_end_time=messages.end_ns,
            message_index_offsets=index_offsets,
            message_index_length=len(record) - length,
        )
        before, self._declared = self._chunks.extent, self._declared + len(head)
        self._chunks.add(encode(index), messages.start_ns, messages.end_ns)
        try:
            self._require_room(len(record))
            self._write(record)
        except OSError:
            self._chunks.extent = before
            raise
        self._schemas += [record for record in declarations if isinstance(record, Schema)]
        self._channels += [record for record in declarations if isinstance(record, Channel)]
        for entry in messages.indexes:
            self._counts[entry.channel_id] = self._counts.get(entry.channel_id, 0) + len(entry.times_ns)

    def _require_room(self, size: int) -> None:
        """Raise OSError if the file cannot take `size` more bytes and its end, without which it would be incomplete."""
        size += self._chunks.extent.size + self._declared + END
        if 0 <= resource.getrlimit(resource.RLIMIT_FSIZE)[0] < self._offset + size:
            raise OSError(errno.EFBIG, os.strerror(errno.EFBIG))
        disk = os.fstatvfs(self._file.fileno())
        if disk.f_blocks and disk.f_bavail * disk.f_frsize < size:  # some file systems in memory have no size
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    def finish(self) -> None:
        """Write the summary and the end."""
        self._write(encode(DataEnd(data_section_crc=0)))
        start = self._offset
        groups = [
            (Opcode.SCHEMA, _join(self._schemas)),
            (Opcode.CHANNEL, _join(self._channels)),
            (Opcode.STATISTICS, encode(self._statistics())),
            (Opcode.CHUNK_INDEX, self._chunks.records()),
            (Opcode.ATTACHMENT_INDEX, _join(self._attachments)),
            (Opcode.METADATA_INDEX, _join(self._metadata)),
        ]
        summary = b""
        offsets = b""
        for opcode, data in groups:
            offsets += encode(
                SummaryOffset(group_length=len(data), group_opcode=opcode, group_start=start + len(summary))
            )
            summary += data
        footer = Footer(summary_start=start, summary_offset_start=start + len(summary), summary_crc=0)
        summary += offsets
        footer.summary_crc = zlib.crc32(summary + encode(footer)[:-_CRC])
        self._write(summary + encode(footer) + MCAP0_MAGIC)

    def close(self) -> None:
        """Delete the index of the records."""
        self._chunks.close()

    def _statistics(self) -> Statistics:
        extent = self._chunks.extent
        return Statistics(
            attachment_count=len(self._attachments),
            channel_count=len(self._channels),
            channel_message_counts=self._counts,
            chunk_count=extent.chunks,
            message_count=sum(self._counts.values()),
            message_start_time=extent.start_ns or 0,
            message_end_time=extent.end_ns,
            metadata_count=len(self._metadata),
            schema_count=len(self._schemas),
        )

    def _write(self, data: bytes) -> None:
        """Write all data or none: a file on a full disk ends with its last complete record."""
        remaining = memoryview(data)
        try:
            while remaining:
                remaining = remaining[self._file.write(remaining) :]
        except OSError:
            with suppress(OSError):
                self._file.seek(self._offset)
                self._file.truncate()
            raise
        self._offset += len(data)


def _join(records: Sequence[McapRecord]) -> bytes:
    return b"".join(map(encode, records))


def encode(record: McapRecord) -> bytes:
    """Return the bytes of a record."""
    builder = RecordBuilder()
    record.write(builder)
    return builder.end()
