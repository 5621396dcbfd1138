"""Simulation time in messages: integer nanoseconds since the start of the simulation to `Time` and back."""

from lapwing.messages.types import Header, Time

_SECOND = 1_000_000_000


def stamp(time_ns: int) -> Time:
    """`Time` of an instant [ns]."""
    return Time(*divmod(time_ns, _SECOND))


def nanoseconds(time: Time) -> int:
    """Instant [ns] of a `Time`."""
    return time.sec * _SECOND + time.nanosec


def header(time_ns: int, frame_id: str) -> Header:
    """Header for an instant [ns] and the frame that the message's vectors are expressed in."""
    return Header(stamp(time_ns), frame_id)


def stamp_ns(header: Header) -> int:
    """Instant [ns] of a header."""
    return nanoseconds(header.stamp)
