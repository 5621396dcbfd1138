"""Messages of one shape as numpy records: many are encoded at once from columns of numbers.

A message whose strings and sequence lengths are known has a fixed layout: its payload is one record of a structured
dtype. Fields overlap: "pose" (7,), "pose.position" (3,) and "pose.position.x" are the same bytes.
"""

from collections.abc import Callable, Mapping
from difflib import get_close_matches
from functools import lru_cache
from typing import Any, Self

import numpy as np

from lapwing.messages.cdr_layout import Layout
from lapwing.messages.parse import PRIMITIVES

WHOLE = "CDR"
"""Field of a record that covers all its bytes; numpy copies only fields, so strings and padding would be lost."""

_SECOND = 1_000_000_000


@lru_cache(maxsize=1024)
def record_dtype(layout: Layout) -> np.dtype:
    """Return the structured dtype of a payload: its numbers by dotted name, little-endian, at their offsets.

    Arrays and sequences of numbers are subarrays. A nested message of float64 only is also one subarray
    ("pose.orientation" (4,) in the order of its fields: x, y, z, w), as is a sequence of k of them ("moment" (k, 3)
    in addition to "moment.0" (3,) and "moment.0.x"). Strings and lengths have no field; the last field, `WHOLE`, is the
    payload.
    """
    fields: dict[str, tuple[Any, int]] = {}
    floats: dict[str, list[int]] = {}  # by name of a nested message or of a sequence of them: offsets of its values
    mixed: set[str] = set()  # those that contain anything but single float64
    for entry in layout.entries:
        code = "<" + PRIMITIVES.get(entry.base, "")
        if entry.kind == "value":
            fields[entry.name] = (code, entry.offset)
        elif entry.kind == "array":
            fields[entry.name] = ((code, (entry.length,)), entry.offset)
        for name in _parents(entry.name):
            floats.setdefault(name, []).append(entry.offset)
            if (entry.kind, entry.base) != ("value", "float64"):
                mixed.add(name)
    counts = {entry.name: entry.length for entry in layout.entries if entry.kind == "length"}
    for name, offsets in floats.items():
        if name not in mixed:
            shape = (len(offsets),) if name not in counts else (counts[name], len(offsets) // counts[name])
            fields[name] = (("<f8", shape), offsets[0])
    fields[WHOLE] = (f"V{layout.codec.size}", 0)
    return np.dtype(
        {
            "names": list(fields),
            "formats": [format_ for format_, _ in fields.values()],
            "offsets": [offset for _, offset in fields.values()],
            "itemsize": layout.codec.size,
        }
    )


def number_fields(dtype: np.dtype) -> tuple[str, ...]:
    """Return the fields of a `record_dtype` that hold numbers."""
    return (dtype.names or ())[:-1]


def _parents(name: str) -> list[str]:
    """Return the names of all fields that contain a field: "pose.0", "pose" of "pose.0.x"."""
    parts = name.split(".")
    return [".".join(parts[:k]) for k in range(len(parts) - 1, 0, -1)]


class Record:
    """Template of a message with fixed strings and sequence lengths.

    Attributes:
        message: the message class.
        dtype: dtype of one payload with its encapsulation header; see `record_dtype`.
        template: payload of the sample.
    """

    def __init__(self, message: Any, sample: Any) -> None:
        """Store the shape and the default values of a sample of the message class."""
        self.message = message
        self.template: bytes = sample.encode()
        self.dtype = record_dtype(message.layouts.measure(self.template))

    @classmethod
    def of(cls, sample: Any) -> Self:
        """Return the record of a sample message; the dtype is created once for each shape."""
        return cls(type(sample), sample)

    def encode(self, n: int, columns: Mapping[str, Any]) -> np.ndarray:
        """Encode n messages.

        Args:
            n: number of messages.
            columns: values of the n messages by dotted field name, shape (n,) or (n, k) for a field of k values; or one
                value for all, shape () or (k,); or a function that returns them. Later columns overwrite earlier ones.

        Returns:
            Records, shape (n,); fields without a column are as in the sample. They may be selected and copied, but
            not concatenated: numpy then changes the layout. Concatenate their bytes (`view(np.uint8)`).

        Raises:
            ValueError: the field does not exist, a column has another shape, or an integer field cannot hold a number.
        """
        payloads = np.empty((n, len(self.template)), np.uint8)
        payloads[:] = np.frombuffer(self.template, np.uint8)
        records = payloads.view(self.dtype).reshape(n)
        for name, column in columns.items():
            records[name] = self._fit(n, name, np.asarray(column() if callable(column) else column))
        return records

    def _fit(self, n: int, name: str, column: np.ndarray) -> np.ndarray:
        """Return a column in the field's type, with a shape that broadcasts to the field's."""
        if name not in number_fields(self.dtype):
            raise ValueError(f"{self.message.type_name}: {unknown_field(name, number_fields(self.dtype))}")
        field = self.dtype[name]
        if column.shape == (n,) and field.shape == (1,):
            column = column[:, None]
        if column.shape not in ((), field.shape, (n, *field.shape)):
            expected = " or ".join(dict.fromkeys(str(shape) for shape in ((n, *field.shape), field.shape, ())))
            raise ValueError(f"{self.message.type_name}: column {name} has shape {column.shape}, expected {expected}")
        if column.dtype.kind not in "biuf":
            raise ValueError(f"{self.message.type_name}: column {name} holds {column.dtype}, expected numbers")
        if field.base.kind == "f" or column.dtype == field.base:
            return column
        with np.errstate(invalid="ignore"):  # NaN is detected below
            converted = column.astype(field.base)
        if not np.array_equal(converted, column):
            raise ValueError(f"{self.message.type_name}: column {name} holds values that {field.base} cannot")
        return converted


def stamp_columns(times_ns: np.ndarray, field: str = "header.stamp") -> dict[str, Callable[[], np.ndarray]]:
    """Return lazy columns of a field of type `Time`, computed only if they are read.

    Args:
        times_ns: times [ns], int64, shape (n,).
        field: name of the field: "clock", "transforms.0.header.stamp".
    """
    times_ns = np.asarray(times_ns, np.int64)
    return {f"{field}.sec": lambda: times_ns // _SECOND, f"{field}.nanosec": lambda: times_ns % _SECOND}


def quaternion_columns(wxyz: Any) -> np.ndarray:
    """Convert quaternions w, x, y, z, shape (n, 4), to a message's order x, y, z, w; columns are contiguous."""
    result = np.empty((4, len(wxyz)))  # numpy copies whole columns in two thirds of the time
    for column, part in zip(result, (1, 2, 3, 0), strict=True):
        column[...] = wxyz[:, part]
    return result.T


def unknown_field(name: str, names: tuple[str, ...]) -> str:
    """Return the error text for an unknown field, with the nearest names."""
    near = get_close_matches(name, names, n=4, cutoff=0.4) or sorted(names)[:8]
    return f"no field {name}; near it: {', '.join(near)}"
