"""Encoding and decoding of the frames of one endpoint, with sequence numbers, checks and signatures (pymavlink).

Frames of messages that contain only numbers, as most telemetry does, take less than half of pymavlink's time.
The most frequent messages are pairs of class and values (`Numbers`), which saves the message object.
"""

import re
import struct
from collections import Counter
from collections.abc import Callable, Iterator
from functools import cache
from operator import attrgetter, itemgetter
from typing import Any, NamedTuple

from lapwing.services.common.mavlink.dialect import mavlink
from lapwing.services.mavlink.signing import Signature

Numbers = tuple[Any, tuple]
"""Message class of pymavlink, and its values in the order of the class's arguments. None of them is a string."""

_HEADER = "<BBBBBBBHB"  # MAVLink guide, "Packet Serialization": magic to message id (24 bits)
_HEADER_SIZE = struct.calcsize(_HEADER)
_CHECKSUM = struct.Struct("<H")


class _Kind(NamedTuple):
    """Constants of a message class."""

    attributes: Callable[[Any], tuple]  # fields of a message object, in wire order
    reorder: Callable[[tuple], tuple]  # from the order of the arguments to wire order
    arrays: tuple[int, ...]  # indices of the arrays, in descending order
    layout: struct.Struct  # header, payload, CRC_EXTRA
    size: int  # [bytes] payload
    low: int  # 16 bits of the message id; a message's own `id` may be one of its fields
    high: int  # 8 bits of the message id
    seed: int  # CRC_EXTRA


@cache
def _kind(message_type: Any) -> _Kind | None:
    """Return the constants of a message class. Return None for one with texts or a single field."""
    names = message_type.ordered_fieldnames
    letters = message_type.native_format.decode()
    if len(names) < 2 or {"c", "s"} & set(letters):
        return None
    arrays = tuple(k for k, length in reversed(list(enumerate(message_type.array_lengths))) if length)
    order = itemgetter(*[message_type.orders.index(i) for i in range(len(names))])
    fields = message_type.unpacker.format.removeprefix("<")
    layout, number = struct.Struct(f"{_HEADER}{fields}B"), message_type.id
    size = message_type.unpacker.size
    low, high = number & 0xFFFF, number >> 16
    return _Kind(attrgetter(*names), order, arrays, layout, size, low, high, message_type.crc_extra)


def frame(message: Any, sequence: int, system: int, component: int) -> bytes | None:
    """Return the unsigned MAVLink 2 frame of a message or of `Numbers`.

    Return None for a message with texts or a single field.
    """
    if type(message) is tuple:
        kind = _kind(message[0])
        assert kind is not None
        values = kind.reorder(message[1])
    else:
        message_type: Any = type(message)
        kind = _kind(message_type)
        if kind is None:
            return None
        values = kind.attributes(message)
    if kind.arrays:
        flat = list(values)
        for k in kind.arrays:
            flat[k : k + 1] = flat[k]
        values = tuple(flat)
    _, _, _, layout, size, low, high, seed = kind
    content = layout.pack(_MAGIC, size, 0, 0, sequence, system, component, low, high, *values, seed)
    if not content[-2]:  # zeros at the end of a payload are not sent, except the first byte
        content = content[:_HEADER_SIZE] + (content[_HEADER_SIZE:-1].rstrip(b"\0") or b"\0") + content[-1:]
        content = content[:1] + bytes((len(content) - _HEADER_SIZE - 1,)) + content[2:]
    return content[:-1] + _CHECKSUM.pack(_crc(content[1:], 0xFFFF))


def _slow_crc(data: bytes, crc: int) -> int:
    checksum = mavlink.x25crc()
    checksum.crc = crc
    checksum.accumulate(data)
    return checksum.crc


_MAGIC = mavlink.PROTOCOL_MARKER_V2
_crc: Callable[[bytes, int], int] = getattr(mavlink, "mcrf4xx", None) or _slow_crc  # CRC-16/MCRF4XX


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
