"""Chunks in logs of other programs: read in any compression, rejected if they would fill the memory."""

import os
import re
import subprocess
import sys
import tracemalloc
import zlib

import lz4.frame
import pytest
import zstandard
from mcap.records import Channel, Chunk, Message, Schema
from mcap.writer import MCAP0_MAGIC

import lapwing
from lapwing.cosim.log import LogReader, mcap_contents
from lapwing.cosim.log.mcap_writer import encode
from tests.commands import run_command

MESSAGE = encode(Message(channel_id=1, data=b"hello", log_time=5, publish_time=5, sequence=0))
LARGEST = 1 << 20  # [bytes], 1/256 of the default
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
    path.write_bytes(MCAP0_MAGIC + b"".join(map(encode, (schema, channel, chunk))))
    return path


@pytest.mark.parametrize(("name", "pack"), [("lz4", lz4_of), ("zstd", zstd_of), ("zstd", zstd_of_unknown_size)])
def test_packed_chunks_are_read(name, pack, tmp_path):
    path = write(tmp_path / "log.mcap", name, pack(MESSAGE), len(MESSAGE), zlib.crc32(MESSAGE))
    with LogReader(path) as log:
        assert list(log.messages()) == [("/any", "Any", 5, b"hello")]


@pytest.mark.parametrize("printed", [100, len(BOMB)], ids=["small", "large"])
@pytest.mark.parametrize(("name", "pack"), [("lz4", lz4_of), ("zstd", zstd_of), ("zstd", zstd_of_unknown_size)])
def test_decompression_bombs_are_rejected_early(name, pack, printed, monkeypatch, tmp_path):
    monkeypatch.setattr(mcap_contents, "LARGEST", LARGEST)
    path = write(tmp_path / "log.mcap", name, pack(BOMB), printed)
    tracemalloc.start()
    try:
        with pytest.raises(ValueError, match=r"damaged chunk|its chunks unpack to over"):
            LogReader(path)
        assert tracemalloc.get_traced_memory()[1] < 4 * LARGEST
    finally:
        tracemalloc.stop()


def write_many(path, count, size):
    """Write a log of chunks that unpack to `size` zero bytes each, from a few bytes in the file."""
    packed = zstandard.compress(bytes(size))
    chunk = encode(
        Chunk("zstd", packed, message_start_time=5, message_end_time=5, uncompressed_crc=0, uncompressed_size=size)
    )
    path.write_bytes(MCAP0_MAGIC + count * chunk)
    return path


@pytest.mark.parametrize("command", [["info"], ["report"], ["verify"], ["export", "--csv", "out"], ["resimulate"]])
def test_command_rejects_log_that_unpacks_beyond_limit(command, tmp_path):
    log = write_many(tmp_path / "bomb.mcap", 40, 64 << 20)  # 2.7 GB from 100 kB
    name, *options = command
    result = run_command(name, log, *options, code=2, folder=tmp_path)
    assert re.fullmatch(
        r"lapwing: .*bomb\.mcap: its chunks unpack to over \d+ MB; expected at most 200 times .*\n", result.stderr
    )


@pytest.mark.long
def test_memory_is_at_most_eight_times_payloads(tmp_path):
    read = (
        "import resource, sys, lapwing; lapwing.read_log(sys.argv[1]).rmse;"
        "print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024)"
    )
    sizes, peaks = [], []
    for seconds in (4.0, 60.0):
        scene = {"run.duration": seconds, "trajectory.phase.1.duration": 90.0, "success.require": []}
        log = lapwing.fly("hover", scene).save(tmp_path / f"{seconds:g}.mcap")
        with LogReader(log) as reader:
            sizes.append(sum(len(payload) for _, _, _, payload in reader.messages()))
        environment = os.environ | {"PYTHONPATH": os.getcwd()}
        output = subprocess.run(
            [sys.executable, "-c", read, str(log)], env=environment, capture_output=True, text=True, check=True
        )
        peaks.append(int(output.stdout))
    assert peaks[1] - peaks[0] < 8.0 * (sizes[1] - sizes[0])
