"""Frames of messages of numbers, as nearly all of the telemetry: pymavlink's bytes in less than half of its time."""

import struct
from collections.abc import Callable
from functools import cache
from operator import attrgetter
from typing import Any, NamedTuple

from lapwing.services.common.mavlink.dialect import mavlink

_HEADER = struct.Struct("<BBBBBBBHB")  # MAVLink guide, "Packet Serialization": magic to message id (24 bits)
_CHECKSUM = struct.Struct("<H")


class _Kind(NamedTuple):
    """Constants of a message class."""

    fields: Callable[[Any], tuple]  # of a message, in the order of the wire
    arrays: tuple[int, ...]  # places of those that are arrays, the last first
    layout: struct.Struct
    number: int  # a message's own `id` may be one of its fields
    seed: bytes  # CRC_EXTRA


@cache
def _kind(message_type: Any) -> _Kind | None:
    """Return the constants of a message class. Return None for one with texts or a single field."""
    names = message_type.ordered_fieldnames
    if len(names) < 2 or {"c", "s"} & set(message_type.native_format.decode()):
        return None
    arrays = tuple(k for k, length in reversed(list(enumerate(message_type.array_lengths))) if length)
    return _Kind(attrgetter(*names), arrays, message_type.unpacker, message_type.id, bytes((message_type.crc_extra,)))


def frame(message: Any, sequence: int, system: int, component: int) -> bytes | None:
    """Return the unsigned MAVLink 2 frame of a message. Return None for one with texts or a single field."""
    message_type: Any = type(message)
    kind = _kind(message_type)
    if kind is None:
        return None
    values = kind.fields(message)
    if kind.arrays:
        flat = list(values)
        for k in kind.arrays:
            flat[k : k + 1] = flat[k]
        values = tuple(flat)
    payload = kind.layout.pack(*values).rstrip(b"\0") or b"\0"
    low, high = kind.number & 0xFFFF, kind.number >> 16
    header = _HEADER.pack(mavlink.PROTOCOL_MARKER_V2, len(payload), 0, 0, sequence, system, component, low, high)
    content = header + payload
    return content + _CHECKSUM.pack(mavlink.x25crc(content[1:] + kind.seed).crc)
