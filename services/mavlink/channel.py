"""Encoding and decoding of the frames of one endpoint, with sequence numbers, checks and signatures (pymavlink)."""

from collections import Counter
from collections.abc import Iterator
from typing import Any

from lapwing.services.common.mavlink.dialect import mavlink
from lapwing.services.mavlink.framing import frame
from lapwing.services.mavlink.signing import Signature

UNSIGNED = "unsigned, forged or replayed"


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
        message = codec.parse_char(data)
        while message is not None:
            kind = message.get_type()
            if kind == "BAD_DATA":
                reason = _reason(message.reason)
                self._counts[reason] += 1
                self._framed |= reason == UNSIGNED
                if not self._framed:
                    self.foreign = True
                    return
            elif kind.startswith("UNKNOWN_"):
                self._counts["unknown message"] += 1
            else:
                self._framed = True
                yield message
            message = codec.parse_char(b"")
        del codec.buf[: codec.buf_index]
        codec.buf_index = 0


def _reason(reason: str) -> str:
    if "signature" in reason:
        return UNSIGNED
    return "wrong checksum" if "CRC" in reason else "not MAVLink"
