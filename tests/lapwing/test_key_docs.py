"""Documentation of keys from the code: types, bounds, defaults, comments behind fields."""

from typing import Annotated, Literal, NamedTuple, get_args

import pytest
from annotated_types import Gt, Le
from pydantic import BaseModel, Field

from lapwing.dynamics import effects
from lapwing.dynamics.field_comments import comments, split
from lapwing.dynamics.vehicles.airframe import Airframe
from lapwing.file_schemas.annotations import schema_of
from lapwing.file_schemas.descriptions import effect_settings
from lapwing.file_schemas.json_schema import sensor_tables
from lapwing.file_schemas.key_docs import REQUIRED, keys
from lapwing.services.scene_resolver import vocabulary
from lapwing.services.sensors.fault_schedule import FaultTable
from lapwing.services.trajectory.phases import Phase
from lapwing.services.trajectory.segments import KINDS


class Base(BaseModel):
    """Base class."""

    first: float = Field(gt=0.0)  # [m/s] how fast


class Sample(Base):
    """A table. With a second sentence."""

    second: tuple[float, float] = (0.0, 1.0)  # [m], [rad] both
    third: Literal["a", "b"] = "a"


class Plain(NamedTuple):
    """Class without pydantic, like the classes of effects."""

    size: Annotated[float, Gt(0), Le(5)] = 1.0  # [kg]


def test_comments_follow_fields_and_include_base_classes():
    assert comments(Sample) == {"first": "[m/s] how fast", "second": "[m], [rad] both"}


@pytest.mark.parametrize(
    ("comment", "expected"),
    [
        ("[m] of one foot", ("m", "of one foot")),
        ("[1/s]", ("1/s", "")),
        ("[m], [rad] by axis", ("m, rad", "by axis")),
        ("follow the scene's [trajectory]", ("", "follow the scene's [trajectory]")),
    ],
)
def test_comment_begins_with_unit(comment, expected):
    assert split(comment) == expected


def test_keys_have_bounds_defaults_units_and_meanings():
    first, second, third = keys(Sample)
    assert (first.name, first.default, first.unit, first.meaning) == ("first", REQUIRED, "m/s", "how fast")
    assert schema_of(first.hint) == {"type": "number", "exclusiveMinimum": 0.0}
    assert schema_of(second.hint) == {"type": "array", "items": {"type": "number"}, "minItems": 2, "maxItems": 2}
    assert (third.default, schema_of(third.hint)) == ("a", {"enum": ["a", "b"]})
    (size,) = keys(Plain)
    assert schema_of(size.hint) == {"type": "number", "exclusiveMinimum": 0, "maximum": 5}


def _tables():
    """Return all tables of user files and their nested tables."""
    result = [*vocabulary().sections.values(), *KINDS.values(), Airframe, Phase, FaultTable]
    result += [effect_settings(name) for name in effects.names()] + [cls for _, cls in sensor_tables().values()]
    for table in result:
        result += [
            cls for key in keys(table) if key.name != "faults" for cls in _classes(key.hint) if cls not in result
        ]
    return result


def _classes(hint):
    if isinstance(hint, type) and (issubclass(hint, BaseModel) or hasattr(hint, "_fields")):
        return [hint]
    return [result for part in get_args(hint) for result in _classes(part)]


@pytest.mark.parametrize("table", _tables(), ids=lambda cls: f"{cls.__module__}.{cls.__name__}")
def test_every_key_has_unit_or_description(table):
    silent = [key.name for key in keys(table) if not (key.unit or key.meaning)]
    assert silent == (["kind"] if table in KINDS.values() else []), f"complete the comments in {table.__module__}"
