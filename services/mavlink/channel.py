"""Encoding and decoding of the frames of one endpoint, with sequence numbers, checks and signatures (pymavlink)."""

import re
from collections import Counter
from collections.abc import Iterator
from typing import Any

from lapwing.services.common.mavlink.dialect import mavlink
from lapwing.services.mavlink.framing import frame
from lapwing.services.mavlink.signing import Signature

UNSIGNED = "unsigned, forged or replayed"
_V1, _V2 = mavlink.PROTOCOL_MARKER_V1, mavlink.PROTOCOL_MARKER_V2
_MARKER = re.compile(rb"\xfd(?=.[\0\1]|.?\Z)|\xfe", re.DOTALL)  # MAVLink 2: followed by a length and known flags


class _Codec(mavlink.MAVLink):
    signature: Signature | None = None

    def check_signature(self, msgbuf: bytearray, srcSystem: int, srcComponent: int) -> bool:
        """Check as the library does, but keep the time stamp of a stream if a forged frame has a later one."""
        assert self.signature
        self.signature.advance()
        times = self.signing.stream_timestamps
        stream = (msgbuf[-13], srcSystem, srcComponent)
        before = times.get(stream)
        if super().check_signature(msgbuf, srcSystem, srcComponent):
            self.signature.accept(stream)
            return True
        if before is None:
            times.pop(stream, None)
        else:
            times[stream] = before
        return False


class Channel:
    """Frames of one endpoint."""

    def __init__(
        self,
        source: tuple[int, int],
        signature: Signature | None,
        datagrams: bool,
        counts: Counter[str],
        strict: bool = False,
    ):
        """Create the channel.

        Args:
            source: system and component id of the vehicle, until `set_source`.
            signature: signs and checks frames; None for no signing.
            datagrams: True if no frame continues from one piece of bytes to the next.
            counts: rejected messages by reason.
            strict: True to ignore an endpoint whose first bytes are not a frame.
        """
        self._codec = _Codec(None, *source)
        self._codec.robust_parsing = True
        self._signature = signature
        if signature:
            self._codec.signing, self._codec.signature = signature.state, signature
        self._datagrams, self._counts = datagrams, counts
        self._framed = not strict  # a frame was received, signed or not
        self.foreign = False  # the first bytes were not a frame

    def set_source(self, source: tuple[int, int]) -> None:
        """Set system and component id of the vehicle in further frames."""
        self._codec.srcSystem, self._codec.srcComponent = source

    def encode(self, message: Any) -> bytes:
        """Return the next frame of a message or `Numbers`. Return no bytes, and count it, if a value does not fit."""
        codec = self._codec
        if self._signature:
            self._signature.advance()
        try:
            data = None if self._signature else frame(message, codec.seq, codec.srcSystem, codec.srcComponent)
            if data is None:
                data = (message[0](*message[1]) if type(message) is tuple else message).pack(codec)
        except OverflowError:
            self._counts["value out of range of its field"] += 1
            return b""
        codec.seq = (codec.seq + 1) % 256
        return data

    def decode(self, data: bytes) -> Iterator[Any]:
        """Yield the valid messages in a piece of bytes; count the others."""
        codec = self._codec
        if self._datagrams:
            codec.buf, codec.buf_index, codec.expected_length = bytearray(), 0, mavlink.HEADER_LEN_V1 + 2
        message = codec.parse_char(data) or self._next_in_stream()
        while message is not None:
            kind = message.get_type()
            if kind == "BAD_DATA":
                reason = _reason(message.reason)
                self._counts[reason] += 1
                self._framed |= reason == UNSIGNED
                if not self._framed:
                    self.foreign = True
                    return
                if reason != UNSIGNED and message.data[0] in (_V1, _V2):
                    self._resume_in(message.data)
            elif kind.startswith("UNKNOWN_"):
                self._counts["unknown message"] += 1
                self._resume_in(message.data)  # its checksum cannot be checked
            else:
                self._framed = True
                yield message
            message = codec.parse_char(b"") or self._next_in_stream()
        del codec.buf[: codec.buf_index]
        codec.buf_index = 0

    def _next_in_stream(self) -> Any:
        """Return a message behind the pending bytes if these cannot become a frame.

        Otherwise a marker in garbage swallows as many frames as the length behind it covers.
        """
        codec, message = self._codec, None
        while message is None and not self._datagrams and self._framed and codec.buf_len():
            pending = bytes(codec.buf[codec.buf_index :])
            if _find_frame(pending) == 0:
                break
            codec.buf_index = len(codec.buf)
            self._counts["not MAVLink"] += 1
            self._resume_in(pending)
            message = codec.parse_char(b"")
        return message

    def _resume_in(self, rejected: bytes) -> None:
        """Continue in a stream with the first possible frame behind the marker of rejected bytes, just read."""
        codec = self._codec
        if self._datagrams:
            return
        start = 1 + _find_frame(rejected[1:])
        codec.buf, codec.buf_index = bytearray(rejected[start:]) + codec.buf[codec.buf_index :], 0


def _find_frame(data: bytes) -> int:
    """Return the index of the first bytes that may begin a frame of a known message; the length if there are none."""
    for marker in _MARKER.finditer(data):
        head = data[marker.start() : marker.start() + mavlink.HEADER_LEN_V2]
        if len(head) < (mavlink.HEADER_LEN_V2 if head[0] == _V2 else mavlink.HEADER_LEN_V1):
            return marker.start()
        number = int.from_bytes(head[7:], "little") if head[0] == _V2 else head[5]
        kind = mavlink.mavlink_map.get(number)
        if kind and (head[0] == _V2 or head[1] <= kind.unpacker.size):  # MAVLink 2 has extensions unknown here
            return marker.start()
    return len(data)


def _reason(reason: str) -> str:
    if "signature" in reason:
        return UNSIGNED
    return "wrong checksum" if "CRC" in reason else "not MAVLink"
