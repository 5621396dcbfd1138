"""Random messages of every type."""

import random
import struct
from typing import Any

from lapwing.messages import TYPES
from lapwing.messages.types import DEFINITIONS

RANGES = {
    "byte": (0, 255), "char": (0, 255), "int8": (-128, 127), "uint8": (0, 255), "int16": (-(2**15), 2**15 - 1),
    "uint16": (0, 2**16 - 1), "int32": (-(2**31), 2**31 - 1), "uint32": (0, 2**32 - 1),
    "int64": (-(2**63), 2**63 - 1), "uint64": (0, 2**64 - 1),
}  # fmt: skip


def sample(type_name: str, rng: random.Random) -> Any:
    """Return a random message of a type."""
    return TYPES[type_name](*(_field(field, rng) for field in DEFINITIONS[type_name].fields))


def _field(field, rng):
    if field.length is None:
        return _element(field.base, rng)
    return tuple(_element(field.base, rng) for _ in range(field.length or rng.choice((0, 1, 2, 3, 4, 7))))


def _element(base, rng):
    if base == "bool":
        return rng.random() < 0.5
    if base == "string":
        return "".join(rng.choice("abc/_é鳥 ") for _ in range(rng.randrange(12)))
    if base == "float32":
        return struct.unpack("<f", struct.pack("<f", rng.gauss(0, 100)))[0]
    if base == "float64":
        return rng.gauss(0, 1e3)
    if base in RANGES:
        return rng.randint(*RANGES[base])
    return sample(base, rng)


def varied(message: Any, rng: random.Random) -> Any:
    """Return the message with other numbers; strings and lengths of sequences are unchanged."""
    fields = DEFINITIONS[message.type_name].fields
    return type(message)(*(_varied(field.base, getattr(message, field.name), rng) for field in fields))


def _varied(base, value, rng):
    if hasattr(value, "type_name"):
        return varied(value, rng)
    if isinstance(value, tuple):
        return tuple(_varied(base, item, rng) for item in value)
    return value if base == "string" else _element(base, rng)


def value(message: Any, name: str) -> Any:
    """Return a field by its dotted name."""
    for part in name.split("."):
        message = message[int(part)] if part.isdecimal() else getattr(message, part)
    return message


def flat(item: Any) -> list[Any]:
    """Return the numbers and strings of nested tuples as a list."""
    return [leaf for part in item for leaf in flat(part)] if isinstance(item, tuple) else [item]
