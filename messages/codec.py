"""Message classes generated from their definitions: named tuples that encode to and decode from ROS 2 CDR.

Python source is generated and compiled for each type: `encode` flattens the nested tuples into the arguments of the
layout's `pack`, `decode` builds them from the flat values. No field is looked up by name.
"""

import struct
from collections import namedtuple
from typing import Any

from lapwing.messages.cdr_layout import ENCAPSULATION, Layouts
from lapwing.messages.parse import PRIMITIVES, Definition, Field, schema_text

_ENCODE = """
def encode(self):
    try:
{body}
        shape = ({shape})
        layout = by_shape(shape) or build(shape)
        return layout.codec.pack({arguments})
    except FAULTS as fault:
        raise ValueError("{type_name}: cannot encode: " + str(fault)) from None
"""
_DECODE = """
def decode(payload):
    v = unpack(payload)
    try:
{body}
        return {result}
    except UnicodeDecodeError as fault:
        raise ValueError("{type_name}: a string is not UTF-8: " + str(fault)) from None
"""


def make_class(definition: Definition, definitions: dict[str, Definition], classes: dict[str, type]) -> type:
    """Return the message class of a definition.

    Args:
        definition: the type.
        definitions: all types, by full name.
        classes: existing classes; must contain every type that this one contains.

    The class is a named tuple with the definition's fields, defaults (zero if none is specified) and constants, and

    - `type_name`: "sensor_msgs/msg/Imu"; `schema_text`: the `ros2msg` text with all contained types;
    - `layouts`: field offsets in a payload, by the lengths of its strings and sequences;
    - `encode() -> bytes` and `decode(bytes)` (static): ROS 2 CDR, little-endian. Sequences and arrays decode to
      tuples. Both raise ValueError, with the type's name, for values or payloads that do not fit.
    """
    name = definition.type_name.rsplit("/", 1)[1]
    defaults = [_default(field, classes) for field in definition.fields]
    fields = namedtuple(name, [field.name for field in definition.fields], defaults=defaults)  # type: ignore[misc]
    members: dict[str, Any] = {"__slots__": (), "__module__": "lapwing.messages.types", "__doc__": definition.text}
    members |= definition.constants
    members["type_name"] = definition.type_name
    members["schema_text"] = schema_text(definition.type_name, definitions)
    cls = type(name, (fields,), members)

    layouts = Layouts(definition, definitions)
    scope: dict[str, Any] = {_identifier(base): contained for base, contained in classes.items()} | {
        _identifier(definition.type_name): cls,
        "by_shape": layouts.by_shape.get,
        "build": layouts.build,
        "unpack": layouts.unpack,
        "new": tuple.__new__,
        "FAULTS": (struct.error, AttributeError, TypeError, ValueError),
    }
    for source in (_Encoder(definitions).source(definition), _Decoder(definitions).source(definition)):
        exec(compile(source, f"<codec of {definition.type_name}>", "exec"), scope)
    cls.layouts = layouts  # type: ignore[attr-defined]
    cls.encode = scope["encode"]  # type: ignore[attr-defined]
    cls.decode = staticmethod(scope["decode"])  # type: ignore[attr-defined]
    return cls


def _default(field: Field, classes: dict[str, type]) -> Any:
    if field.length is None:
        return classes[field.base]() if field.nested else field.default
    return (_zero(field.base),) * field.length


def _zero(base: str) -> Any:
    return {"?": False, "f": 0.0, "d": 0.0}.get(PRIMITIVES.get(base, ""), 0)


def _identifier(type_name: str) -> str:
    return type_name.replace("/", "_")


class _Writer:
    """Lines of a function body, with fresh variable names."""

    def __init__(self, definitions: dict[str, Definition]) -> None:
        self.definitions = definitions
        self.lines: list[str] = []
        self.depth = 2
        self.count = 0

    def fresh(self, stem: str) -> str:
        self.count += 1
        return f"{stem}_{self.count}"

    def line(self, text: str) -> None:
        self.lines.append("    " * self.depth + text)

    def body(self) -> str:
        return "\n".join(self.lines)


class _Encoder(_Writer):
    """Source of `encode`: each method returns the lengths (shape) and the flat values (arguments) of its part."""

    def source(self, definition: Definition) -> str:
        shape, arguments = self.fields(definition, "self")
        return _ENCODE.format(
            body=self.body(),
            shape="".join(item + ", " for item in shape),
            arguments=", ".join([str(ENCAPSULATION), *arguments]),
            type_name=definition.type_name,
        )

    def fields(self, definition: Definition, source: str) -> tuple[list[str], list[str]]:
        names = [self.fresh(field.name) for field in definition.fields]
        self.line(f"{', '.join(names)}, = {source}")
        shape: list[str] = []
        arguments: list[str] = []
        for field, name in zip(definition.fields, names, strict=True):
            lengths, values = self.field(field, name)
            shape += lengths
            arguments += values
        return shape, arguments

    def field(self, field: Field, name: str) -> tuple[list[str], list[str]]:
        if field.length is None:
            return self.element(field.base, name)
        if field.length:
            self.line(f"if len({name}) != {field.length}:")
            self.line(f"    raise ValueError('{field.name} has %d values, not {field.length}' % len({name}))")
            return [], [f"*{name}"]
        length = self.fresh("length")
        self.line(f"{length} = len({name})")
        if field.base in PRIMITIVES:
            return [length], [length, f"*{name}"]
        shapes, values, item = self.fresh("shapes"), self.fresh("values"), self.fresh("item")
        self.line(f"{shapes}, {values} = [{length}], [{length}]")
        self.line(f"for {item} in {name}:")
        self.depth += 1
        item_shape, item_values = self.element(field.base, item)
        self.line(f"{shapes} += ({''.join(text + ', ' for text in item_shape)})")
        self.line(f"{values} += ({''.join(text + ', ' for text in item_values)})")
        self.depth -= 1
        return [f"*{shapes}"], [f"*{values}"]

    def element(self, base: str, name: str) -> tuple[list[str], list[str]]:
        if base in PRIMITIVES:
            return [], [name]
        if base != "string":
            return self.fields(self.definitions[base], name)
        length = self.fresh("length")
        self.line(f"{name} = {name}.encode()")
        self.line(f"{length} = len({name}) + 1")
        return [length], [length, name]


class _Decoder(_Writer):
    """Source of `decode`: each method returns the expression of its part and advances in the flat values `v`.

    The index is a number while all previous counts are fixed, then a variable plus a number.
    """

    def source(self, definition: Definition) -> str:
        self.start, self.offset = "", 1
        result = self.element(definition.type_name)
        return _DECODE.format(body=self.body() or "        pass", result=result, type_name=definition.type_name)

    def index(self, offset: int = 0) -> str:
        return f"{self.start}{self.offset + offset}"

    def take(self, count: int) -> str:
        first = self.index()
        self.offset += count
        return f"v[{first}:{self.index()}]"

    def element(self, base: str) -> str:
        if base in PRIMITIVES or base == "string":
            self.offset += 1 if base in PRIMITIVES else 2
            return f"v[{self.index(-1)}]" + (".decode()" if base == "string" else "")
        fields = self.definitions[base].fields
        if all(field.base in PRIMITIVES and field.length is None for field in fields):
            return f"new({_identifier(base)}, {self.take(len(fields))})"
        return f"new({_identifier(base)}, ({''.join(self.field(field) + ', ' for field in fields)}))"

    def field(self, field: Field) -> str:
        if field.length is None:
            return self.element(field.base)
        if field.length:
            return self.take(field.length)
        begin, end = self.fresh("begin"), self.fresh("end")
        count = f"v[{self.index()}]"
        self.line(f"{begin} = {self.index(1)}")
        if field.base in PRIMITIVES:
            self.line(f"{end} = {begin} + {count}")
            self.start, self.offset = f"{end} + ", 0
            return f"v[{begin}:{end}]"
        items = self.fresh("items")
        self.line(f"{items}, {end} = [], {begin}")
        self.line(f"for _ in range({count}):")
        self.depth += 1
        self.start, self.offset = f"{end} + ", 0
        self.line(f"{items}.append({self.element(field.base)})")
        self.line(f"{end} = {self.index()}")
        self.depth -= 1
        self.start, self.offset = f"{end} + ", 0
        return f"tuple({items})"
