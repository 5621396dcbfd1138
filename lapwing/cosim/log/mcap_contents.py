"""Contents of an MCAP file: declarations, positions of the chunks, and messages of a chunk."""

import io
import os
import struct
from collections.abc import Collection
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

import zstandard
from lz4.frame import LZ4FrameDecompressor
from mcap import records
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.stream_reader import get_chunk_data_stream
from mcap.writer import MCAP0_MAGIC

from lapwing.cosim.log.mcap_writer import METADATA, METADATA_END

_RECORD = struct.Struct("<BQ")  # opcode, length of the remaining record
_MESSAGE = struct.Struct("<HIQQ")  # channel, sequence, log time, publish time; then the payload
_CHUNK = struct.Struct("<QQQ")  # times of the first and last message, unpacked size
_CHANNEL = struct.Struct("<H")
_DECLARATIONS: dict[int, Any] = {
    Opcode.SCHEMA: records.Schema,
    Opcode.CHANNEL: records.Channel,
    Opcode.METADATA: records.Metadata,
    Opcode.ATTACHMENT: records.Attachment,
}

ROS2 = "ros2msg"  # encoding of schemas
LARGEST = 1 << 28  # [bytes] limit of a chunk; usual writers make chunks of a few million
RATIO = 200  # limit of unpacked bytes beyond one chunk, relative to the size of the file; logs of Lapwing: 2 to 5


def has_footer(path: Path) -> bool:
    """Return True if a file has the footer of a complete MCAP file. Raise OSError if it cannot be read."""
    with path.open("rb") as file:
        file.seek(max(0, path.stat().st_size - len(MCAP0_MAGIC)))
        return file.read() == MCAP0_MAGIC


class ChunkInfo(NamedTuple):
    """Position of a chunk, times of its first and last message, and its channels."""

    offset: int  # [bytes]
    start_ns: int
    end_ns: int
    channels: set[int]  # according to the index of the chunk; empty: unknown

    def may_hold(self, channels: Collection[int]) -> bool:
        """Return True if it can hold a message of these channels."""
        return not self.channels or not self.channels.isdisjoint(channels)


class UnchunkedError(ValueError):
    """File with messages outside of chunks, which Lapwing does not write."""


class Contents:
    """Contents of a file.

    Attributes:
        metadata: content of the records `lapwing` and `lapwing_end`.
        attachments: contents by file name.
        schemas: type name by schema id.
        definitions: text of the type by schema id, for ROS 2 encodings.
        channels: channels by id.
        chunks: in order of the file.
        complete: True if the file has its end.
        damaged: a line for each damaged chunk, with `skip_damaged` only.

    Raises:
        ValueError: not an MCAP file, or damaged.
    """

    def __init__(self, path: Path, file: BinaryIO, skip_damaged: bool = False) -> None:
        self.metadata: dict[str, str] = {}
        self.attachments: dict[str, bytes] = {}
        self.schemas: dict[int, str] = {}
        self.definitions: dict[int, str] = {}
        self.channels: dict[int, records.Channel] = {}
        self.chunks: list[ChunkInfo] = []
        self.complete = False
        self.damaged: tuple[str, ...] = ()
        self._path, self._file = path, file
        try:
            self._scan()
        except struct.error as fault:
            raise ValueError(f"{path}: damaged record: {fault}") from None
        if skip_damaged or not (self.complete and self.channels):
            self._read_declarations(skip_damaged)

    def read_chunk(self, offset: int, channels: Collection[int]) -> list[tuple[int, int, bytes]]:
        """Return time [ns], channel and payload of a chunk's messages of some channels, in order of writing.

        Raises:
            ValueError: the chunk is damaged.
        """
        self._file.seek(offset + _RECORD.size)
        try:
            chunk = records.Chunk.read(ReadDataStream(self._file))
            _check_size(chunk)
            _unpack_lz4(chunk)
            stream, size = get_chunk_data_stream(chunk, validate_crc=True)
            data = stream.read(size)
            return self._messages(data, size, channels)
        except Exception as fault:  # any error of the decompressor, or invalid records
            raise ValueError(f"{self._path}: damaged chunk at byte {offset}: {fault}") from None

    def _messages(self, data: bytes, size: int, channels: Collection[int]) -> list[tuple[int, int, bytes]]:
        result = []
        place = 0
        while place < size:
            opcode, length = _RECORD.unpack_from(data, place)
            place += _RECORD.size
            if opcode == Opcode.MESSAGE:
                channel, _, time_ns, _ = _MESSAGE.unpack_from(data, place)
                if channel in channels:
                    result.append((time_ns, channel, data[place + _MESSAGE.size : place + length]))
            elif opcode in _DECLARATIONS:
                self._declare(opcode, data[place : place + length])
            place += length
        return result

    def _scan(self) -> None:
        """Read all records except chunks, whose positions are stored."""
        file = self._file
        size = os.fstat(file.fileno()).st_size
        if file.read(len(MCAP0_MAGIC)) != MCAP0_MAGIC:
            foreign = "not an MCAP file; `lapwing import` converts the logs of autopilots"
            raise ValueError(f"{self._path}: {foreign if size else 'is empty; expected a log (MCAP)'}")
        offset, unpacked = len(MCAP0_MAGIC), 0
        while offset + _RECORD.size <= size:
            opcode, length = _RECORD.unpack(file.read(_RECORD.size))
            if opcode == 0 or offset + _RECORD.size + length > size:
                break  # truncated record
            if opcode == Opcode.FOOTER:
                self.complete = True
                break
            if opcode == Opcode.CHUNK:
                start_ns, end_ns, chunk_size = _CHUNK.unpack(file.read(_CHUNK.size))
                unpacked += chunk_size
                if unpacked > RATIO * size + LARGEST:
                    message = f"its chunks unpack to over {unpacked / 1e6:.0f} MB"
                    raise ValueError(f"{self._path}: {message}; expected at most {RATIO} times the size of the file")
                self.chunks.append(ChunkInfo(offset, start_ns, end_ns, set()))
            elif opcode == Opcode.MESSAGE_INDEX and self.chunks:
                self.chunks[-1].channels.add(*_CHANNEL.unpack(file.read(_CHANNEL.size)))
            elif opcode == Opcode.MESSAGE:
                raise UnchunkedError(f"{self._path}: has messages outside of chunks; expected a chunked log")
            elif opcode in _DECLARATIONS:
                self._declare(opcode, file.read(length))
            offset += _RECORD.size + length
            file.seek(offset)
        if not self.complete and self.chunks:
            self.chunks[-1].channels.clear()  # its index may lack channels

    def _read_declarations(self, skip_damaged: bool) -> None:
        """Read the declarations inside chunks. Leave out chunks that cannot be read, or raise ValueError."""
        for chunk in list(self.chunks):
            try:
                self.read_chunk(chunk.offset, ())
            except ValueError as fault:
                if not skip_damaged:
                    raise
                self.damaged += (str(fault).removeprefix(f"{self._path}: "),)
                self.chunks.remove(chunk)

    def _declare(self, opcode: int, data: bytes) -> None:
        try:
            record = _DECLARATIONS[opcode].read(ReadDataStream(io.BytesIO(data)))
        except (McapError, struct.error, UnicodeDecodeError, OverflowError, MemoryError) as fault:
            raise ValueError(f"{self._path}: damaged {Opcode(opcode).name.lower()} record: {fault}") from None
        if isinstance(record, records.Schema):
            self.schemas[record.id] = record.name
            if record.encoding == ROS2:
                self.definitions[record.id] = record.data.decode(errors="replace")
        elif isinstance(record, records.Channel):
            self.schemas.setdefault(record.schema_id, "")
            self.channels[record.id] = record
        elif isinstance(record, records.Attachment):
            self.attachments[record.name] = record.data
        elif record.name in (METADATA, METADATA_END):
            self.metadata |= record.metadata


def _check_size(chunk: records.Chunk) -> None:
    """Raise ValueError if one of the two declared sizes of a chunk exceeds `LARGEST`."""
    size = chunk.uncompressed_size
    if chunk.compression == "zstd":
        size = max(size, zstandard.frame_content_size(chunk.data))  # -1: unknown
    if size > LARGEST:
        raise ValueError(f"{size} bytes, expected at most {LARGEST}")


def _unpack_lz4(chunk: records.Chunk) -> None:
    """Unpack an LZ4 chunk with a limit, which the reader of mcap does not have; an LZ4 frame need not state its size.

    Raises:
        ValueError: the chunk is larger than `LARGEST`, or truncated.
    """
    if chunk.compression != "lz4":
        return
    decompressor = LZ4FrameDecompressor()
    data = decompressor.decompress(chunk.data, max_length=LARGEST)
    if not decompressor.eof:
        raise ValueError(f"truncated, or larger than {LARGEST} bytes")
    chunk.compression, chunk.data = "", data
