"""ROS 2 message types, their CDR encoding, and the topic table.

`from lapwing.messages import Imu, header`: the classes are generated from `msg/<package>/<Name>.msg`; a new message is
a new file.
"""

from typing import Any

from lapwing.messages import types
from lapwing.messages.time_stamps import header, nanoseconds, stamp, stamp_ns
from lapwing.messages.types import TYPES, message_class

__all__ = ["TYPES", "header", "message_class", "nanoseconds", "stamp", "stamp_ns"]
__all__ += [cls.__name__ for cls in TYPES.values()]


def __getattr__(name: str) -> Any:
    """Return a message class by its short name."""
    return getattr(types, name)
