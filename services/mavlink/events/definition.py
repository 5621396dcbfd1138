"""Declaration of events: name, text, arguments, severity.

Texts and arguments follow libevents, the format of MAVLink's Events Interface: "{1}" is the first argument. A ground
station reads them from the vehicle's metadata; messages contain numbers only.
"""

import struct
import zlib
from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple, Protocol, TypeVar

from lapwing.services.common.event_kinds import KINDS
from lapwing.services.common.mavlink.dialect import mavlink
from lapwing.services.mavlink.vehicle_cache import VehicleCache

FORMATS = {"uint8_t": "B", "uint32_t": "I"}
EMERGENCY, CRITICAL, WARNING = (
    mavlink.MAV_SEVERITY_EMERGENCY,
    mavlink.MAV_SEVERITY_CRITICAL,
    mavlink.MAV_SEVERITY_WARNING,
)
INFO = mavlink.MAV_SEVERITY_INFO
PROTOCOL = 8  # not displayed
_COMPONENT = mavlink.MAV_COMP_ID_AUTOPILOT1


class Entry(NamedTuple):
    """A value of an enumeration."""

    value: int
    name: str
    text: str  # displayed


class Enumeration(NamedTuple):
    """Enumeration of values; in a bit field each value is a bit."""

    name: str  # ends with _t
    type: str
    entries: Sequence[Entry]
    bits: bool = False


class Argument(NamedTuple):
    """Numeric argument of an event."""

    name: str
    type: str | Enumeration

    @property
    def base(self) -> str:
        """Type of the argument in messages."""
        return self.type.type if isinstance(self.type, Enumeration) else self.type


class Definition(NamedTuple):
    """Declaration of an event."""

    name: str
    kind: str  # name in lapwing.services.common.event_kinds
    message: str
    arguments: tuple[Argument, ...]
    level: int
    group: str
    type: str  # type within its group, "" for none
    description: str

    @property
    def sub_id(self) -> int:
        """Number of the event within its component, 24 bits: a checksum of its name."""
        return zlib.crc32(self.name.encode()) & 0xFFFFFF

    @property
    def id(self) -> int:
        """Number of the event in messages: the component's number in the upper 8 bits, then `sub_id`."""
        return _COMPONENT << 24 | self.sub_id

    def encode(self, values: Sequence[int]) -> bytes:
        """Return the values of the arguments as little-endian bytes, in the order of `arguments`."""
        return struct.pack("<" + "".join(FORMATS[a.base] for a in self.arguments), *values)


Occurrence = tuple[Definition, Sequence[int]]  # event and the values of its arguments


class EventDetector(Protocol):
    """Detector of one group of events."""

    def step(self, v: VehicleCache) -> Iterator[Occurrence]:
        """Yield the events since the previous step."""


Kind = TypeVar("Kind", bound=Callable[[], EventDetector])

DEFINITIONS: dict[str, Definition] = {}
"""All declared events by name."""
DETECTORS: list[Callable[[], EventDetector]] = []
"""Event detectors."""


def event(
    name: str,
    kind: str,
    message: str,
    *arguments: Argument,
    level: int | None = None,
    group: str = "default",
    type_: str = "",
    description: str = "",
) -> Definition:
    """Declare an event.

    Args:
        name: unique name.
        kind: name in lapwing.services.common.event_kinds; determines the severity if `level` is None.
        message: one line; "{1}" is the first argument.
        arguments: arguments in their order.
        level: MAV_SEVERITY, or PROTOCOL.
        group: group of libevents.
        type_: type of libevents.
        description: longer description.
    """
    if level is None:
        level = WARNING if KINDS[kind].serious else INFO
    definition = Definition(name, kind, message, arguments, level, group, type_, description)
    DEFINITIONS[name] = definition
    return definition


def detector(cls: Kind) -> Kind:
    """Declare a class as a detector of events."""
    DETECTORS.append(cls)
    return cls
