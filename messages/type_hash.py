"""Type hashes of ROS 2 (REP 2011, version RIHS01): SHA-256 of a type's fields and of those of all types in it.

Two nodes exchange messages only if their hashes agree; rmw_zenoh has the hash in the key of a topic.
"""

import hashlib
import json
from collections.abc import Mapping
from functools import cache
from typing import Any

from lapwing.messages.parse import Definition, Field, dependencies
from lapwing.messages.types import DEFINITIONS

# Numbers of type_description_interfaces/msg/FieldType; in a .msg file char is another name of uint8.
_NESTED = 1
_TYPE_IDS = {
    "int8": 2,
    "uint8": 3,
    "char": 3,
    "int16": 4,
    "uint16": 5,
    "int32": 6,
    "uint32": 7,
    "int64": 8,
    "uint64": 9,
    "float32": 10,
    "float64": 11,
    "bool": 15,
    "byte": 16,
    "string": 17,
}
_ARRAY, _SEQUENCE = 48, 144  # added to the type id for `T[n]` and `T[]`


def type_hash(type_name: str, definitions: Mapping[str, Definition]) -> str:
    """Return the hash of a type, "RIHS01_" and 64 hexadecimal digits; `definitions` has all types by full name."""
    contained = sorted(set(dependencies(type_name, dict(definitions))))
    description = {
        "type_description": _describe(definitions[type_name]),
        "referenced_type_descriptions": [_describe(definitions[name]) for name in contained],
    }
    return "RIHS01_" + hashlib.sha256(json.dumps(description).encode()).hexdigest()


@cache
def known_type_hash(type_name: str) -> str:
    """Return the `type_hash` of a type of `messages/msg` by its full name."""
    return type_hash(type_name, DEFINITIONS)


def _describe(definition: Definition) -> dict[str, Any]:
    return {"type_name": definition.type_name, "fields": [_field(field) for field in definition.fields]}


def _field(field: Field) -> dict[str, Any]:
    array_id = 0 if field.length is None else _ARRAY if field.length else _SEQUENCE
    kind = {
        "type_id": array_id + (_NESTED if field.nested else _TYPE_IDS[field.base]),
        "capacity": field.length or 0,
        "string_capacity": 0,  # no bounded strings
        "nested_type_name": field.base if field.nested else "",
    }
    return {"name": field.name, "type": kind}
