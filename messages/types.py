"""Message classes, generated from the `.msg` files next to this module: `lapwing.messages.types.Imu` and so on."""

import re
from functools import cache
from pathlib import Path
from typing import Any

from lapwing.messages.codec import make_class
from lapwing.messages.parse import read_folder

TYPES: dict[str, Any] = {}
"""Message class by full name ("sensor_msgs/msg/Imu")."""

FOLDER = Path(__file__).parent / "msg"
_UNIT = re.compile(r"\s*[A-Za-z][\w/]*(?:\[\d*\])?\s+(?P<name>[A-Za-z]\w*)[^#]*#[^\[]*\[(?P<unit>[^\]]+)\]")

DEFINITIONS = read_folder(FOLDER)
"""Definitions of all types by full name, each after the types that it contains."""

for _name, _definition in DEFINITIONS.items():
    TYPES[_name] = make_class(_definition, DEFINITIONS, TYPES)
_by_name = {cls.__name__: cls for cls in TYPES.values()}
if len(_by_name) != len(TYPES):
    raise ValueError("messages/msg: two packages hold a message of the same name")
globals().update(_by_name)


def message_class(type_name: str) -> Any:
    """Return the class of a full type name.

    Raises:
        ValueError: the type is unknown; the message lists the choices.
    """
    if type_name not in TYPES:
        raise ValueError(f"unknown message type {type_name}; known: {', '.join(sorted(TYPES))}")
    return TYPES[type_name]


def unit(type_name: str, field: str) -> str:
    """Return the unit that the comment of a field's line states ("[rad/s]"), by dotted name; "" without one.

    The containing field defines the unit if the field's own line does not.
    """
    result = ""
    for name in field.split("."):
        if name.isdigit():
            continue  # an element of a sequence
        result = _units(type_name).get(name, result)
        type_name = next((f.base for f in DEFINITIONS[type_name].fields if f.name == name and f.nested), "")
        if not type_name:
            break
    return result


@cache
def _units(type_name: str) -> dict[str, str]:
    matches = map(_UNIT.match, DEFINITIONS[type_name].text.splitlines())
    return {match["name"]: match["unit"] for match in matches if match}


def __getattr__(name: str) -> Any:
    """Raise AttributeError for a missing name; also marks the names as dynamic for type checkers."""
    raise AttributeError(f"module 'lapwing.messages.types' has no message {name!r}")
