"""Attachment of every Zenoh put, in the layout of the ROS 2 middleware rmw_zenoh.

33 bytes, little-endian: sequence number (int64), source time [ns] (int64), the length 16 of the identifier (one
byte), and the publisher's 16-byte global identifier (GID). A ROS 2 node drops samples without an attachment.
"""

import struct

_LAYOUT = struct.Struct("<qqB16s")
SIZE = _LAYOUT.size
_GID_SIZE = 16
_GID_OFFSET = SIZE - _GID_SIZE
_TIME = struct.Struct("<q")


def pack(sequence: int, time_ns: int, gid: bytes) -> bytes:
    """Return the 33 bytes of an attachment.

    Raises:
        ValueError: the GID does not have 16 bytes.
    """
    if len(gid) != _GID_SIZE:
        raise ValueError(f"attachment: the publisher's identifier has {len(gid)} bytes, expected {_GID_SIZE}")
    return _LAYOUT.pack(sequence, time_ns, _GID_SIZE, gid)


def time_and_gid(data: bytes) -> tuple[int, bytes]:
    """Return source time [ns] and GID of an attachment, for the hot path.

    Raises:
        ValueError: the bytes are not an attachment.
    """
    if len(data) != SIZE or data[_GID_OFFSET - 1] != _GID_SIZE:
        raise ValueError(f"not an attachment: {len(data)} bytes")
    return _TIME.unpack_from(data, 8)[0], data[_GID_OFFSET:]
