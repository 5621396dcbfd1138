"""Chunk indexes of a log until its summary is written: bytes in memory, or in an unnamed file if there are many."""

from pathlib import Path
from tempfile import SpooledTemporaryFile
from typing import NamedTuple

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
