"""ROS 2 message types, their CDR encoding, and the topic table.

`from lapwing.messages import Imu, header`: the classes are generated from `msg/<package>/<Name>.msg`; a new message is
a new file.
"""

from typing import Any

from lapwing.messages import types
from lapwing.messages.types import TYPES, Header, Time, message_class

__all__ = ["TYPES", "header", "message_class", "nanoseconds", "stamp", "stamp_ns"]
__all__ += [cls.__name__ for cls in TYPES.values()]

_SECOND = 1_000_000_000  # [ns]


def __getattr__(name: str) -> Any:
    """Return a message class by its short name."""
    return getattr(types, name)


def stamp(time_ns: int) -> Time:
    """Return the `Time` of a time [ns]."""
    return Time(*divmod(time_ns, _SECOND))


def nanoseconds(time: Time) -> int:
    """Return the time [ns] of a `Time`."""
    return time.sec * _SECOND + time.nanosec


def header(time_ns: int, frame_id: str) -> Header:
    """Return the header for a time [ns] and the frame of the message's vectors."""
    return Header(stamp(time_ns), frame_id)


def stamp_ns(header: Header) -> int:
    """Return the time [ns] of a header."""
    return nanoseconds(header.stamp)
