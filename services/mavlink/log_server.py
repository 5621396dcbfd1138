"""Download of the run's log, which may still grow (MAVLink guide, "Log protocol")."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from lapwing.services.common.mavlink.dialect import mavlink

NUMBER = 1  # number of the only log
PIECE = 90  # [bytes] of one LOG_DATA
PER_STEP = 100  # messages at each step of the telemetry


class LogServer:
    """Server that lists the log and sends the requested bytes, a few messages at a time."""

    def __init__(self, path: Path | None):
        """Create a server of the log at `path`; None: no log."""
        self._path = path
        self._next = self._end = 0  # [bytes] range that remains to be sent
        self._due = False  # a request needs a reply, which may be empty

    @property
    def _size(self) -> int:
        try:
            return self._path.stat().st_size if self._path else 0
        except OSError:
            return 0

    def entries(self, first: int, last: int) -> Any:
        """Return LOG_ENTRY messages of a range of logs, with the size written so far."""
        if self._path is None or not self._size or not first <= NUMBER <= last:
            return mavlink.MAVLink_log_entry_message(0, 0, 0, 0, 0)
        return mavlink.MAVLink_log_entry_message(NUMBER, 1, NUMBER, int(self._path.stat().st_mtime), self._size)

    def request(self, number: int, offset: int, count: int) -> None:
        """Start to send `count` bytes from an offset; this replaces the previous request."""
        self._next = offset
        self._end = min(self._size, offset + count) if number == NUMBER else offset
        self._end = max(self._end, offset)
        self._due = True

    def stop(self) -> None:
        """Cancel the request."""
        self._next = self._end = 0
        self._due = False

    def step(self) -> Sequence[Any]:
        """Return the next LOG_DATA messages."""
        if not self._due:
            return ()
        messages = []
        data = self._read(self._next, min(PER_STEP * PIECE, self._end - self._next))
        for start in range(0, max(1, len(data)), PIECE):
            piece = data[start : start + PIECE]
            padded = list(piece.ljust(PIECE, b"\0"))
            messages.append(mavlink.MAVLink_log_data_message(NUMBER, self._next + start, len(piece), padded))
        self._next += len(data)
        self._due = bool(data) and self._next < self._end
        return messages

    def _read(self, offset: int, count: int) -> bytes:
        if self._path is None or count <= 0:
            return b""
        try:
            with self._path.open("rb") as file:
                file.seek(offset)
                return file.read(count)
        except OSError:
            return b""
