"""CDR layouts: the byte positions of a message, once the lengths of its strings and sequences are known.

A message type together with these lengths (its *shape*) has a fixed layout, so it is packed and unpacked by a single
precompiled `struct.Struct`. Messages of one topic rarely change shape: a layout is built once and then looked up.

CDR, as ROS 2 uses it: a header of four bytes (0, 1, 0, 0: little-endian), then the fields in order, each aligned to
its own size counted from the end of that header. A string is its length with the closing NUL as uint32 and its bytes;
a sequence is its number of elements as uint32 and the elements.
"""

import struct
from collections.abc import Callable
from operator import itemgetter

from messages.parse import PRIMITIVES, Definition

ENCAPSULATION = 256  # the header's bytes 0, 1, 0, 0 read as little-endian uint32
_CAPACITY = 4096  # layouts kept per type before starting afresh: free text could otherwise fill the memory
_UINT32 = struct.Struct("<I")


class Layout:
    """The layout of one shape: `codec` packs the flat values, the encapsulation header first."""

    def __init__(self, format_: str, shape: tuple[int, ...], places: list[int]) -> None:
        self.codec = struct.Struct(format_)
        self._lengths = itemgetter(0, *places)  # header and every length among the flat values
        self._expected = (ENCAPSULATION, *shape) if places else ENCAPSULATION

    def fits(self, values: tuple) -> bool:
        """Whether values unpacked with this layout belong to it.

        The first length stands where it stands in every shape; if it agrees, so does the place of the second, and so
        on: when all agree, the layout is the message's own.
        """
        return self._lengths(values) == self._expected


class Layouts:
    """All layouts of one message type met so far."""

    def __init__(self, definition: Definition, definitions: dict[str, Definition]) -> None:
        self._definition = definition
        self._definitions = definitions
        self._by_size: dict[int, Layout] = {}
        self.by_shape: dict[tuple[int, ...], Layout] = {}

    def build(self, shape: tuple[int, ...]) -> Layout:
        """The layout of a shape: the lengths in order of appearance, strings counted with their NUL."""
        lengths = iter(shape)
        return self._walk(lambda position: next(lengths))

    def unpack(self, payload: bytes) -> tuple:
        """Flat values of a payload.

        Raises:
            ValueError: the payload is not little-endian CDR, or shorter or longer than its own lengths say.
        """
        size = len(payload)
        layout = self._by_size.get(size)
        if layout is not None:
            values = layout.codec.unpack(payload)
            if layout.fits(values):
                return values
        layout = self._measure(payload)
        if len(self._by_size) >= _CAPACITY:
            self._by_size.clear()
        self._by_size[size] = layout
        return layout.codec.unpack(payload)

    def _measure(self, payload: bytes) -> Layout:
        name, size = self._definition.type_name, len(payload)
        if size < 4 or _UINT32.unpack_from(payload)[0] != ENCAPSULATION:
            raise ValueError(f"{name}: payload starts with {bytes(payload[:4])!r}, expected CDR header 00 01 00 00")

        def length_at(position: int) -> int:
            if position + 8 > size:
                raise ValueError(f"{name}: payload of {size} bytes ends before the length at byte {position + 4}")
            (length,) = _UINT32.unpack_from(payload, position + 4)
            if length > size - position - 8:  # every element takes at least one byte
                raise ValueError(
                    f"{name}: length {length} at byte {position + 4} runs past the end of the payload ({size} bytes)"
                )
            return length

        layout = self._walk(length_at)
        if layout.codec.size != size:
            raise ValueError(f"{name}: payload has {size} bytes, expected {layout.codec.size}")
        return layout

    def _walk(self, length_at: Callable[[int], int]) -> Layout:
        """Walk the type, asking for each length with its position (after the header)."""
        parts = ["<I"]
        shape: list[int] = []
        places: list[int] = []
        position, values = 0, 1  # bytes after the header, flat values so far

        def put(code: str, count: int = 1) -> None:
            nonlocal position, values
            size = struct.calcsize("<" + code)
            padding = -position % size
            parts.append(f"{padding}x{count}{code}")
            position += padding + count * size
            values += count

        def put_length() -> int:
            length = length_at(position + -position % 4)
            places.append(values)
            shape.append(length)
            put("I")
            return length

        def put_string() -> None:
            nonlocal position, values
            length = put_length()
            parts.append(f"{length - 1}sx" if length else "0s")  # some writers send length 0 for the empty string
            position += length
            values += 1

        def put_element(base: str) -> None:
            if base == "string":
                put_string()
            else:
                put_fields(self._definitions[base])

        def put_fields(definition: Definition) -> None:
            for field in definition.fields:
                code = PRIMITIVES.get(field.base)
                if code and field.length is None:
                    put(code)
                elif code:
                    count = field.length or put_length()
                    if count:
                        put(code, count)
                else:
                    for _ in range(1 if field.length is None else put_length()):
                        put_element(field.base)

        put_fields(self._definition)
        key = tuple(shape)
        layout = self.by_shape.get(key)
        if layout is None:
            if len(self.by_shape) >= _CAPACITY:
                self.by_shape.clear()
            layout = self.by_shape[key] = Layout("".join(parts), key, places)
        return layout
