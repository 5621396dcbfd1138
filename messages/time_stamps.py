"""Simulation time in messages: integer nanoseconds since the start of the simulation to `Time` and back."""

from lapwing.messages.types import Header, Time

_SECOND = 1_000_000_000


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
