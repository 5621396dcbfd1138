"""Frames of messages that contain only numbers, as most telemetry does, in less than half of pymavlink's time.

The most frequent messages are pairs of class and values (`Numbers`), which saves the message object.
"""

import struct
from collections.abc import Callable
from functools import cache
from operator import attrgetter, itemgetter
from typing import Any, NamedTuple

from lapwing.services.common.mavlink.dialect import mavlink

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
