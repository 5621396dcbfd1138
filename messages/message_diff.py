"""First difference of two messages of one type."""

from collections.abc import Iterator
from typing import Any, NamedTuple


class FieldDifference(NamedTuple):
    """First field in which two messages differ."""

    field: str  # dotted name; "" if only the lengths differ
    one: Any
    other: Any

    @property
    def delta(self) -> float | None:
        """Value of `other` minus value of `one`; None if they are not numbers."""
        numbers = isinstance(self.one, int | float) and isinstance(self.other, int | float)
        return self.other - self.one if numbers else None


def first_difference(message: Any, one: bytes, other: bytes) -> FieldDifference | None:
    """Return the first different field of two encoded messages of a class. Return None if the bytes are equal.

    Raises:
        ValueError: one payload is not a message of the class.
    """
    if one == other:
        return None
    for (field, a), (_, b) in zip(leaves(message.decode(one)), leaves(message.decode(other)), strict=False):
        if repr(a) != repr(b):
            return FieldDifference(field, a, b)
    return FieldDifference("", f"{len(one)} bytes", f"{len(other)} bytes")


def leaves(value: Any, path: str = "") -> Iterator[tuple[str, Any]]:
    """Yield (dotted name, value) of all leaves of a message."""
    if not isinstance(value, tuple):
        yield path, value
        return
    names = getattr(value, "_fields", range(len(value)))
    for name, part in zip(names, value, strict=True):
        yield from leaves(part, f"{path}.{name}" if path else str(name))
