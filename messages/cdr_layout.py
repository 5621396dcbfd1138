"""CDR layouts: the byte positions of a message, which follow from the lengths of its strings and sequences.

A message type together with these lengths (its *shape*) has a fixed layout, so it is packed and unpacked by a single
precompiled `struct.Struct`. Messages of one topic rarely change shape: a layout is built once and then looked up.

CDR, as ROS 2 uses it: a header of four bytes (0, 1, 0, 0: little-endian), then the fields in order, each aligned to
its own size counted from the end of that header. A string is its length with the closing NUL as uint32 and its bytes;
a sequence is its number of elements as uint32 and the elements.
"""

import struct
from collections.abc import Callable
from operator import itemgetter
from typing import NamedTuple

from lapwing.messages.parse import PRIMITIVES, Definition

ENCAPSULATION = 256  # the header's bytes 0, 1, 0, 0 read as little-endian uint32
_HEADER = 4  # [bytes]
_CAPACITY = 4096  # cached layouts per type before the cache is cleared: free text could otherwise fill the memory
_UINT32 = struct.Struct("<I")


class Entry(NamedTuple):
    """Entry at an offset of a payload."""

    name: str  # dotted: "header.frame_id", "rotor_speed", "pose.0.position.x"
    kind: str  # "value", "array" (also a sequence's elements), "string", "length" (of a string or sequence)
    base: str  # "float64", "string"; of a sequence's length "float64[]", "geometry_msgs/msg/Pose[]"
    length: int  # elements of an array, bytes of a string with its NUL, the value of a length, else 1
    offset: int  # [bytes] from the start of the payload

    @property
    def size(self) -> int:
        """Size [bytes]."""
        if self.kind == "length":
            return _UINT32.size
        return self.length if self.kind == "string" else self.length * struct.calcsize("<" + PRIMITIVES[self.base])


class Layout:
    """Layout of one shape: `codec` packs the flat values, the encapsulation header first."""

    def __init__(self, entries: list[Entry]) -> None:
        self.entries = tuple(entries)
        self.shape = tuple(entry.length for entry in entries if entry.kind == "length")
        parts, indices = ["<I"], []
        end, values = _HEADER, 1  # bytes and flat values so far
        for entry in entries:
            if entry.kind == "array" and not entry.length:
                continue
            parts.append(f"{entry.offset - end}x{_format(entry)}")
            if entry.kind == "length":
                indices.append(values)
            end = entry.offset + entry.size
            values += entry.length if entry.kind == "array" else 1
        self.codec = struct.Struct("".join(parts))
        self._lengths = itemgetter(0, *indices)  # header and every length among the flat values
        self._expected = (ENCAPSULATION, *self.shape) if indices else ENCAPSULATION

    def fits(self, values: tuple) -> bool:
        """Return True if values unpacked with this layout belong to it.

        The first length has the same offset in every shape; if it agrees, so does the offset of the second, and so
        on: if all agree, the layout is the message's own.
        """
        return self._lengths(values) == self._expected


def _format(entry: Entry) -> str:
    if entry.kind == "length":
        return "I"
    if entry.kind == "string":
        return f"{entry.length - 1}sx" if entry.length else "0s"  # some writers send length 0 for the empty string
    return f"{entry.length}{PRIMITIVES[entry.base]}"


class Layouts:
    """Cache of the layouts of one message type."""

    def __init__(self, definition: Definition, definitions: dict[str, Definition]) -> None:
        self._definition = definition
        self._definitions = definitions
        self._by_size: dict[int, Layout] = {}
        self.by_shape: dict[tuple[int, ...], Layout] = {}

    def build(self, shape: tuple[int, ...]) -> Layout:
        """Return the layout of a shape: the lengths in order of appearance, strings counted with their NUL."""
        lengths = iter(shape)
        return self._cache(walk(self._definition, self._definitions, lambda offset: next(lengths)))

    def unpack(self, payload: bytes) -> tuple:
        """Return the flat values of a payload.

        Raises:
            ValueError: the payload is not little-endian CDR, or its size does not agree with the lengths in it.
        """
        size = len(payload)
        layout = self._by_size.get(size)
        if layout is not None:
            values = layout.codec.unpack(payload)
            if layout.fits(values):
                return values
        return self._walk(payload).codec.unpack(payload)

    def measure(self, payload: bytes) -> Layout:
        """Return the layout of a payload.

        Raises:
            ValueError: see `unpack`.
        """
        layout = self._by_size.get(len(payload))
        if layout is not None and layout.fits(layout.codec.unpack(payload)):
            return layout
        return self._walk(payload)

    def _walk(self, payload: bytes) -> Layout:
        name, size = self._definition.type_name, len(payload)
        if size < _HEADER or _UINT32.unpack_from(payload)[0] != ENCAPSULATION:
            raise ValueError(f"{name}: payload starts with {bytes(payload[:4])!r}, expected CDR header 00 01 00 00")

        def length_at(offset: int) -> int:
            if offset + 4 > size:
                raise ValueError(f"{name}: payload of {size} bytes ends before the length at byte {offset}")
            (length,) = _UINT32.unpack_from(payload, offset)
            if length > size - offset - 4:  # every element takes at least one byte
                raise ValueError(
                    f"{name}: length {length} at byte {offset} runs past the end of the payload ({size} bytes)"
                )
            return length

        layout = self._cache(walk(self._definition, self._definitions, length_at))
        if layout.codec.size != size:
            raise ValueError(f"{name}: payload has {size} bytes, expected {layout.codec.size}")
        if len(self._by_size) >= _CAPACITY:
            self._by_size.clear()
        self._by_size[size] = layout
        return layout

    def _cache(self, entries: list[Entry]) -> Layout:
        shape = tuple(entry.length for entry in entries if entry.kind == "length")
        layout = self.by_shape.get(shape)
        if layout is None:
            if len(self.by_shape) >= _CAPACITY:
                self.by_shape.clear()
            layout = self.by_shape[shape] = Layout(entries)
        return layout


def walk(definition: Definition, definitions: dict[str, Definition], length_at: Callable[[int], int]) -> list[Entry]:
    """Return all entries of a type's payload, in order.

    Args:
        definition: the type.
        definitions: all types, by full name.
        length_at: returns the length of the string or sequence whose length field has this offset [bytes].
    """
    entries: list[Entry] = []
    end = _HEADER

    def add(name: str, kind: str, base: str, count: int, alignment: int) -> None:
        nonlocal end
        entry = Entry(name, kind, base, count, end + (_HEADER - end) % alignment)
        entries.append(entry)
        end = entry.offset + entry.size

    def put_length(name: str, base: str) -> int:
        length = length_at(end + -end % 4)
        add(name, "length", base, length, 4)
        return length

    def put_element(base: str, name: str) -> None:
        if base == "string":
            add(name, "string", base, put_length(name, base), 1)
        elif base in PRIMITIVES:
            add(name, "value", base, 1, struct.calcsize(PRIMITIVES[base]))
        else:
            put_fields(definitions[base], name + ".")

    def put_fields(message: Definition, prefix: str) -> None:
        for field in message.fields:
            name = prefix + field.name
            if field.length is None:
                put_element(field.base, name)
                continue
            count = field.length or put_length(name, field.base + "[]")
            if field.base in PRIMITIVES:
                add(name, "array", field.base, count, struct.calcsize(PRIMITIVES[field.base]) if count else 1)
            else:
                for number in range(count):
                    put_element(field.base, f"{name}.{number}")

    put_fields(definition, "")
    return entries
