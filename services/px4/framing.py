"""MAVLink frames of the simulator link.

Every step of the lock step costs one frame in each direction, so the few messages of this link are packed here:
pymavlink takes ten times as long. Source: MAVLink guide, "Packet Serialization".
"""

import struct
from binascii import crc_hqx
from typing import NamedTuple

V1, V2 = 0xFE, 0xFD
_SIGNED = 0x01  # incompatibility flag
_SIGNATURE = 13  # [bytes]
_HEADER = struct.Struct("<BBBBBBBHB")
_CHECKSUM = struct.Struct("<H")


_REVERSED = bytes(int(f"{byte:08b}"[::-1], 2) for byte in range(256))  # each byte with its bits in reverse


def checksum(data: bytes, start: int = 0xFFFF) -> int:
    """Return the checksum (CRC-16/MCRF4XX) of a frame's content and its CRC_EXTRA.

    It is the CRC of `binascii.crc_hqx` with the bits of every byte, and of the result, in reverse.
    """
    crc = crc_hqx(data.translate(_REVERSED), start)
    return _REVERSED[crc & 0xFF] << 8 | _REVERSED[crc >> 8]


class Layout(NamedTuple):
    """Wire format of a message."""

    number: int  # message id
    extra: int  # CRC_EXTRA
    fields: struct.Struct  # in wire order, with extensions


def frame(layout: Layout, sequence: int, values: tuple, system: int, component: int) -> bytes:
    """Return the MAVLink 2 frame of a message, without the zeros at its end."""
    payload = layout.fields.pack(*values).rstrip(b"\0") or b"\0"
    number = layout.number
    content = _HEADER.pack(V2, len(payload), 0, 0, sequence, system, component, number & 0xFFFF, number >> 16) + payload
    return content + _CHECKSUM.pack(checksum(content[1:] + bytes((layout.extra,))))


class FrameParser:
    """Parser of a byte stream into messages of known layouts.

    Attributes:
        rejected: frames with a wrong checksum, and runs of bytes outside of frames.
    """

    def __init__(self, layouts: tuple[Layout, ...]):
        """Create a parser; frames of other messages are skipped."""
        self._layouts = {layout.number: layout for layout in layouts}
        self._data = b""
        self._garbage = False
        self.rejected = 0

    @property
    def rest(self) -> int:
        """Number of bytes of an incomplete frame."""
        return len(self._data)

    def parse(self, data: bytes) -> list[tuple[int, tuple]]:
        """Return (message id, values in wire order) of the frames that `data` completes."""
        data, result = self._data + data, []
        at = 0
        while at < len(data):
            if data[at] not in (V1, V2):
                self.rejected += not self._garbage
                self._garbage = True
                at += 1
                continue
            head = 10 if data[at] == V2 else 6
            if len(data) - at < head:
                break
            length = head + data[at + 1] + 2
            if data[at] == V2 and data[at + 2] & _SIGNED:
                length += _SIGNATURE
            if len(data) - at < length:
                break
            number, payload = _content(data, at, head)
            layout = self._layouts.get(number)
            if layout is not None:
                end = at + head + len(payload)
                if checksum(data[at + 1 : end] + bytes((layout.extra,))) != data[end] | data[end + 1] << 8:
                    self.rejected += not self._garbage
                    self._garbage = True
                    at += 1
                    continue
                size = layout.fields.size
                result.append((number, layout.fields.unpack(payload[:size].ljust(size, b"\0"))))
            self._garbage = False
            at += length
        self._data = data[at:]
        return result


def _content(data: bytes, at: int, head: int) -> tuple[int, bytes]:
    """Return message id and payload of the frame at `at`."""
    number = data[at + 7] | data[at + 8] << 8 | data[at + 9] << 16 if head == 10 else data[at + 5]
    return number, data[at + head : at + head + data[at + 1]]
