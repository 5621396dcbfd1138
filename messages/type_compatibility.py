"""Comparison of a message type in a log with the type of this version."""

from lapwing.messages.former_names import with_current_fields
from lapwing.messages.parse import PRIMITIVES, Definition, parse
from lapwing.messages.types import DEFINITIONS, TYPES

_BAR = "=" * 80  # between the types of a schema, as in ROS 2
_HEAD = "MSG: "


def first_type_difference(type_name: str, text: str) -> str:
    """Return the first difference between a recorded and the current definition as text; "" if both are compatible.

    Comments, constants and defaults are not part of a message. An unknown type has no difference.

    Args:
        type_name: full name, "sensor_msgs/msg/Imu".
        text: recorded definition, in the schema encoding `ros2msg`.
    """
    if type_name not in TYPES or not text.strip() or text == TYPES[type_name].schema_text:
        return ""
    try:
        recorded = _fields(type_name, _definitions(type_name, text))
    except (ValueError, LookupError):
        return "has a definition that cannot be read"
    current = _fields(type_name, DEFINITIONS)
    for current_field, recorded_field in zip([*current, ("", "")], [*recorded, ("", "")], strict=False):
        if current_field != recorded_field:
            expected, result = (
                " ".join(field).strip() or "no more fields" for field in (current_field, recorded_field)
            )
            return f"has {result} where this version has {expected}"
    return ""


def _definitions(type_name: str, text: str) -> dict[str, Definition]:
    """Return the types of a schema by full name."""
    result = {}
    for k, part in enumerate(text.replace("\r", "").split(f"{_BAR}\n")):
        name, content = type_name, part
        if k:
            head, _, content = part.partition("\n")
            package, _, short = head.removeprefix(_HEAD).strip().partition("/")
            name = f"{package}/msg/{short.removeprefix('msg/')}"
        result[name] = with_current_fields(parse(name, content))
    return result


def _fields(type_name: str, definitions: dict[str, Definition], prefix: str = "") -> list[tuple[str, str]]:
    """Return type and dotted name of all leaf fields of a type; types with equal layouts count as one."""
    result = []
    for field in definitions[type_name].fields:
        array = "" if field.length is None else f"[{field.length or ''}]"
        if field.nested:
            result += _fields(field.base, definitions, f"{prefix}{field.name}{array}.")
        else:
            result.append((_NAMES.get(PRIMITIVES.get(field.base, ""), field.base) + array, f"{prefix}{field.name}"))
    return result


_NAMES = {layout: name for name, layout in PRIMITIVES.items() if name not in ("byte", "char")}
