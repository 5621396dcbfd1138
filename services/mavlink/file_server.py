"""MAVLink FTP server of read-only files (MAVLink guide, "File Transfer Protocol"), from payload to payloads."""

import struct
import zlib
from collections.abc import Iterator, Mapping

_HEADER = struct.Struct("<HBBBBBxI")  # sequence, session, opcode, size, request's opcode, burst complete, offset
PAYLOAD = 251  # [bytes] of a message
DATA = PAYLOAD - _HEADER.size  # [bytes] of data in it
BURST = 32  # most messages in reply to one request
SESSIONS = 4  # files that one endpoint may have open

TERMINATE, RESET, LIST, OPEN, READ, CRC32, BURST_READ = 1, 2, 3, 4, 5, 14, 15
WRITING = (6, 7, 8, 9, 10, 11, 12, 13)  # create, write, remove, make and remove a directory, open, truncate, rename
ACK, NAK = 128, 129
INVALID_SIZE, INVALID_SESSION, NO_SESSION, END_OF_FILE, UNKNOWN_COMMAND, PROTECTED, NOT_FOUND = 3, 4, 5, 6, 7, 9, 10


class _RejectedError(Exception):
    """Error for a rejected request; its argument is the error code."""


def crc32(data: bytes) -> int:
    """Return the protocol's checksum: CRC-32 with initial value 0 and no final inversion."""
    return zlib.crc32(data, 0xFFFFFFFF) ^ 0xFFFFFFFF


class FileServer:
    """Server of the files for one endpoint, with its open files."""

    def __init__(self, files: Mapping[str, bytes]):
        """Create a server of `files`: contents by path, without a leading slash."""
        self._files = files
        self._open: dict[int, bytes] = {}
        self._last: tuple[bytes, list[bytes]] = (b"", [])

    def replies(self, payload: bytes) -> list[bytes]:
        """Return the reply payloads of a request; a repeated request gets the previous replies."""
        if payload != self._last[0]:
            self._last = payload, list(self._replies(payload))
        return self._last[1]

    def _replies(self, payload: bytes) -> Iterator[bytes]:
        sequence, session, opcode, size, _, _, offset = _HEADER.unpack_from(payload)
        data = payload[_HEADER.size : _HEADER.size + size]

        def reply(code: int, content: bytes, number: int = 1, at: int = offset, last: bool = False) -> bytes:
            head = _HEADER.pack(sequence + number & 0xFFFF, session, code, len(content), opcode, last, at)
            return (head + content).ljust(PAYLOAD, b"\0")

        try:
            if opcode == OPEN:
                session = self._open_session(self._file(data))
                yield reply(ACK, struct.pack("<I", len(self._open[session])))
            elif opcode in (READ, BURST_READ):
                count = BURST if opcode == BURST_READ else 1
                pieces = self._pieces(session, offset, size, count)
                for number, (at, piece) in enumerate(pieces, start=1):
                    yield reply(ACK, piece, number, at, number == len(pieces) and opcode == BURST_READ)
            else:
                yield reply(ACK, self._other(opcode, session, data, offset))
        except _RejectedError as error:
            yield reply(NAK, bytes([error.args[0]]))

    def _other(self, opcode: int, session: int, data: bytes, offset: int) -> bytes:
        """Return the data of the acknowledgement of a request with a single reply."""
        if opcode == CRC32:
            return struct.pack("<I", crc32(self._file(data)))
        if opcode == LIST:
            return self._listing(_path(data), offset)
        if opcode == TERMINATE:
            self._open.pop(session, None)
        elif opcode == RESET:
            self._open.clear()
        elif opcode in WRITING:
            raise _RejectedError(PROTECTED)
        elif opcode:  # 0: no operation
            raise _RejectedError(UNKNOWN_COMMAND)
        return b""

    def _file(self, data: bytes) -> bytes:
        path = _path(data)
        if path not in self._files:
            raise _RejectedError(NOT_FOUND)
        return self._files[path]

    def _open_session(self, content: bytes) -> int:
        free = next((number for number in range(SESSIONS) if number not in self._open), None)
        if free is None:
            raise _RejectedError(NO_SESSION)
        self._open[free] = content
        return free

    def _pieces(self, session: int, offset: int, size: int, count: int) -> list[tuple[int, bytes]]:
        """Return up to `count` pieces of an open file from an offset, as (offset, bytes)."""
        if session not in self._open:
            raise _RejectedError(INVALID_SESSION)
        if not 0 < size <= DATA:
            raise _RejectedError(INVALID_SIZE)
        content = self._open[session]
        if offset >= len(content):
            raise _RejectedError(END_OF_FILE)
        starts = range(offset, min(len(content), offset + count * size), size)
        return [(start, content[start : start + size]) for start in starts]

    def _listing(self, folder: str, offset: int) -> bytes:
        """Return the entries of a folder from an index, as many as fit into a payload."""
        prefix = f"{folder}/" if folder else ""
        inside = [(path.removeprefix(prefix), data) for path, data in self._files.items() if path.startswith(prefix)]
        if not inside:
            raise _RejectedError(NOT_FOUND)
        folders = sorted({name.partition("/")[0] for name, _ in inside if "/" in name})
        entries = [f"D{name}\0" for name in folders]
        entries += [f"F{name}\t{len(data)}\0" for name, data in sorted(inside) if "/" not in name]
        if offset >= len(entries):
            raise _RejectedError(END_OF_FILE)
        listing = b""
        for entry in entries[offset:]:
            if len(listing) + len(entry) > DATA:
                break
            listing += entry.encode()
        return listing


def _path(data: bytes) -> str:
    return data.partition(b"\0")[0].decode(errors="replace").strip("/")
