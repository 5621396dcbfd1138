"""Chunks of other programs' logs: read however they are packed, and refused where they would fill the memory."""

import tracemalloc
import zlib

import lz4.frame
import pytest
import zstandard
from mcap.records import Channel, Chunk, Message, Schema
from mcap.writer import MCAP0_MAGIC

from lapwing.cosim.log import LogReader, mcap_contents
from lapwing.cosim.log.mcap_writer import encoded

MESSAGE = encoded(Message(channel_id=1, data=b"hello", log_time=5, publish_time=5, sequence=0))
LARGEST = 1 << 20  # [bytes] instead of 256 times as much
BOMB = bytes(64 * LARGEST)


def lz4_of(data):
    return lz4.frame.compress(data)


def zstd_of(data):
    return zstandard.compress(data)


def zstd_of_unknown_size(data):
    return zstandard.ZstdCompressor(write_content_size=False).compress(data)


def write(path, compression, packed, size, crc=0):
    chunk = Chunk(
        compression, packed, message_start_time=5, message_end_time=5, uncompressed_crc=crc, uncompressed_size=size
    )
    schema = Schema(data=b"", encoding="", id=1, name="Any")
    channel = Channel(id=1, topic="/any", message_encoding="", metadata={}, schema_id=1)
    path.write_bytes(MCAP0_MAGIC + b"".join(map(encoded, (schema, channel, chunk))))
    return path


@pytest.mark.parametrize(("name", "pack"), [("lz4", lz4_of), ("zstd", zstd_of), ("zstd", zstd_of_unknown_size)])
def test_packed_chunks_are_read(name, pack, tmp_path):
    path = write(tmp_path / "log.mcap", name, pack(MESSAGE), len(MESSAGE), zlib.crc32(MESSAGE))
    with LogReader(path) as log:
        assert list(log.messages()) == [("/any", "Any", 5, b"hello")]


@pytest.mark.parametrize("said", [100, len(BOMB)], ids=["small", "large"])
@pytest.mark.parametrize(("name", "pack"), [("lz4", lz4_of), ("zstd", zstd_of), ("zstd", zstd_of_unknown_size)])
def test_bombs_are_refused_before_they_fill_the_memory(name, pack, said, monkeypatch, tmp_path):
    monkeypatch.setattr(mcap_contents, "LARGEST", LARGEST)
    path = write(tmp_path / "log.mcap", name, pack(BOMB), said)
    tracemalloc.start()
    try:
        with pytest.raises(ValueError, match="damaged chunk"):
            LogReader(path)
        assert tracemalloc.get_traced_memory()[1] < 4 * LARGEST
    finally:
        tracemalloc.stop()
