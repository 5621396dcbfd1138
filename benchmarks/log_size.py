"""Size of a log by compression level and message order, and the least size that its numbers need.

    python -m benchmarks.log_size [LOG]      (of the delivery mission, where none is named)

The floor is no format: each field of each topic by itself, as the best of five arrangements that scientific data is
compressed in (the bytes by their place, of the values or of the differences of first to third order of their bit
patterns, or of their exclusive or with the one before), by LZMA; a column that stands in several topics counts once.
"""

import hashlib
import lzma
import struct
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import zstandard
from mcap.records import Attachment, Chunk, MessageIndex
from mcap.stream_reader import StreamReader, get_chunk_data_stream

from lapwing.cosim.log import LogReader

RECORD = struct.Struct("<BQH")  # opcode, length, channel of a message


def main(log=None):
    with tempfile.TemporaryDirectory() as folder:
        if log is None:
            log = str(Path(folder, "log.mcap"))
            words = ["run", "delivery_mission", "--mode", "single-process", "--log", log]
            subprocess.run([sys.executable, "-m", "lapwing", *words], check=True, stdout=subprocess.DEVNULL)
        chunks, index, files = contents(log)
        print(f"{Path(log).stat().st_size / 1e6:.2f} MB: index of messages {index / 1e6:.2f}, files {files / 1e6:.2f}")
        by_topic = [split(chunk) for chunk in chunks]
        orders = {
            "as written": chunks,
            "by topic": [b"".join(parts.values()) for parts in by_topic],
            "four chunks in one": [b"".join(chunks[k : k + 4]) for k in range(0, len(chunks), 4)],
            "a topic a chunk": [part for parts in by_topic for part in parts.values()],
        }
        for name, pieces in orders.items():
            for level in (1, 2, 3, 6, 9, 19):
                compressor, started = zstandard.ZstdCompressor(level=level), time.process_time()
                size = sum(len(compressor.compress(piece)) for piece in pieces)
                taken = time.process_time() - started
                print(f"{name}, level {level}: {size / 1e6:.2f} MB in {taken:.2f} s of processor time", flush=True)
        print(f"floor of the numbers: {floor(log) / 1e6:.2f} MB")


def contents(log):
    """Uncompressed chunks of flown messages; bytes of the index of messages, and of the files attached."""
    chunks, index, files = [], 0, 0
    with open(log, "rb") as file:
        for record in StreamReader(file, emit_chunks=True).records:
            if isinstance(record, Chunk) and record.compression:
                stream, size = get_chunk_data_stream(record)
                chunks.append(stream.read(size))
            elif isinstance(record, MessageIndex):
                index += 15 + 16 * len(record.records)
            elif isinstance(record, Attachment):
                files += len(record.data)
    return chunks, index, files


def split(chunk):
    """The records of a chunk by channel; what it declares under 0."""
    result, place = {}, 0
    while place < len(chunk):
        opcode, length, channel = RECORD.unpack_from(chunk, place)
        result.setdefault(channel if opcode == 5 else 0, []).append(chunk[place : place + 9 + length])
        place += 9 + length
    return {channel: b"".join(records) for channel, records in sorted(result.items())}


def floor(log):
    with LogReader(log) as read:
        topics = read.histories()
    seen, total = set(), 0
    for _, columns in topics.values():
        for name in columns:
            column = columns[name]
            nested = f"{name}.0" in columns or any(other.startswith(f"{name}.") for other in columns)
            if not isinstance(column, np.ndarray) or column.dtype == object or (column.ndim > 1 and nested):
                continue
            for part in column.reshape(len(column), -1).T:
                key = hashlib.blake2b(np.ascontiguousarray(part).tobytes()).digest()
                total += 0 if key in seen else least(np.ascontiguousarray(part))
                seen.add(key)
    return total


def least(column):
    """Bytes of a column (n,) in the best of the arrangements."""
    arrangements = [column]
    if column.dtype == np.float64:
        bits = column.view(np.int64)
        arrangements.append(bits ^ np.concatenate([[0], bits[:-1]]))
        for order in (1, 2, 3):
            difference = np.diff(bits, order, prepend=[0] * order)
            arrangements.append((difference << 1) ^ (difference >> 63))  # small numbers of either sign have zeros ahead
    rows = [np.ascontiguousarray(a).view(np.uint8).reshape(len(a), -1).T for a in arrangements]
    return min(len(lzma.compress(np.ascontiguousarray(row).tobytes())) for row in rows)


if __name__ == "__main__":
    main(*sys.argv[1:])
