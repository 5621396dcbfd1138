"""Units of a message's fields, as the comments of the `.msg` files state them in brackets: "[rad/s]"."""

import re
from functools import cache

from lapwing.messages.types import DEFINITIONS

_LINE = re.compile(r"\s*[A-Za-z][\w/]*(?:\[\d*\])?\s+(?P<name>[A-Za-z]\w*)[^#]*#[^\[]*\[(?P<unit>[^\]]+)\]")


def unit(type_name: str, field: str) -> str:
    """Return the unit of a field by its dotted name ("pose.position.x"); "" without one.

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
    matches = map(_LINE.match, DEFINITIONS[type_name].text.splitlines())
    return {match["name"]: match["unit"] for match in matches if match}
