"""Numbers of a log's messages in arrays: eight bytes a number, where an object for each message needs twenty times."""

from array import array
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from lapwing.flights.log_import.log_conventions import LogError
from lapwing.flights.log_import.recording import longest_session


class NumberRows:
    """Table of numbers that grows by rows of equal length."""

    def __init__(self) -> None:
        self._numbers, self._width = array("d"), 0

    def append(self, row: Iterable[float]) -> None:
        """Append a row.

        Raises:
            LogError: its length differs from that of the first row.
        """
        before = len(self._numbers)
        self._numbers.extend(row)
        self._width = self._width or len(self._numbers)
        if len(self._numbers) - before != self._width:
            raise LogError("an array changes its length during the log; record the flight again")

    def to_array(self) -> np.ndarray:
        """Return the rows without a copy, shape (n, width); no row may be appended while the array exists."""
        return np.frombuffer(self._numbers).reshape(-1, max(self._width, 1))


class Columns:
    """Columns of all messages of one name.

    Args:
        rows: numbers, shape (n, width).
        fields: columns of each field.
    """

    def __init__(self, rows: np.ndarray, fields: Mapping[str, slice]) -> None:
        self._rows, self._fields = rows, fields

    def __len__(self) -> int:
        return len(self._rows)

    def __contains__(self, field: str) -> bool:
        return field in self._fields

    def stack(self, *fields: str) -> np.ndarray:
        """Return the numbers of the fields side by side, shape (n, k)."""
        return np.column_stack([self._rows[:, self._fields[field]] for field in fields])

    def get(self, field: str, default: float) -> np.ndarray:
        """Return the numbers of a scalar field, shape (n,); those of a missing field are `default`."""
        if field not in self._fields:
            return np.full(len(self), default)
        return np.asarray(self._rows[:, self._fields[field].start])

    @property
    def numbers(self) -> np.ndarray:
        """Positions of the messages among all of the log, shape (n,)."""
        return self._rows[:, 0].astype(int)

    def where(self, mask: np.ndarray) -> "Columns":
        """Return the messages of a mask, shape (n,)."""
        return self if mask.all() else Columns(self._rows[mask], self._fields)


class MessageColumns:
    """Collects the used fields of a log's messages, in the order of recording.

    Args:
        used: fields of each message name to keep; a field may be missing, and may be an array of constant length.
    """

    def __init__(self, used: Mapping[str, Sequence[str]]) -> None:
        self._used = used
        self._clock = array("d")  # [s] of each message, NaN for one without a time
        self._rows: dict[str, NumberRows] = {}
        self._fields: dict[str, dict[str, slice]] = {}

    def __len__(self) -> int:
        return len(self._clock)

    def add(self, message: Any, clock: float) -> None:
        """Append the fields of a message that its first one of this name has; NaN for those that are missing.

        Args:
            message: message of pymavlink.
            clock: time of the vehicle's clock [s], NaN if the message has none.
        """
        name = message.get_type()
        if name not in self._rows:
            self._rows[name], self._fields[name], width = NumberRows(), {}, 1
            for field in self._used[name]:
                if hasattr(message, field):
                    size = np.size(getattr(message, field))
                    self._fields[name][field] = slice(width, width := width + size)
        row = [float(len(self._clock))]
        for field, columns in self._fields[name].items():
            value = getattr(message, field, None)
            if columns.stop - columns.start > 1:
                row.extend(value or [np.nan] * (columns.stop - columns.start))
            else:
                row.append(np.nan if value is None else float(value))
        self._rows[name].append(row)
        self._clock.append(clock)

    @property
    def clock(self) -> np.ndarray:
        """Times of all messages by the vehicle's clock [s], NaN for those without one, shape (n,)."""
        return np.array(self._clock)

    def longest_session(self) -> tuple[dict[str, Columns], int]:
        """Return the columns of the longest part between two restarts of the clock, and the number of parts."""
        used, sessions = longest_session(np.frombuffer(self._clock))
        result = {}
        for name, numbers in self._rows.items():
            rows = numbers.to_array()
            inside = used[rows[:, 0].astype(int)]
            if inside.any():
                result[name] = Columns(rows if inside.all() else rows[inside], self._fields[name])
        return result, sessions
