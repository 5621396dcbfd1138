"""Documentation of keys from the code: types, bounds, defaults, units, descriptions."""

import re
from typing import Annotated, Literal, NamedTuple, get_args

import pytest
from annotated_types import Gt, Le
from page_texts import page_text
from pydantic import BaseModel, Field
from typer.testing import CliRunner

from lapwing.cli.main import app
from lapwing.dynamics import effects
from lapwing.dynamics.field_comments import comments, split
from lapwing.dynamics.vehicles.airframe import Airframe
from lapwing.file_schemas import descriptions
from lapwing.file_schemas.annotations import dereference, schema_of
from lapwing.file_schemas.descriptions import effect_settings
from lapwing.file_schemas.json_schema import SCHEMAS, key_units, sensor_tables
from lapwing.file_schemas.key_docs import REQUIRED, keys
from lapwing.services.scene_resolver import vocabulary
from lapwing.services.sensors.fault_schedule import FaultTable
from lapwing.services.trajectory.phases import Phase
from lapwing.services.trajectory.segments import KINDS
from tests.commands import run_command


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


def test_units_come_from_scene_and_airframe_schemas():
    keys = (
        "vehicle.mass", "effects.random_wind_force.sigma", "airframe.motor.resistance", "solver.step", "run.seed",
        "a.b",
    )  # fmt: skip
    assert key_units(keys) == {
        "vehicle.mass": "kg",
        "effects.random_wind_force.sigma": "m/s",
        "airframe.motor.resistance": "ohm",
        "solver.step": "s",
    }


@pytest.mark.long
def test_campaign_report_has_units_of_parameters(tmp_path):
    command = ["campaign", "hover", "--runs", "12", "--workers", "1", "--out", "c"]
    command += ["--vary", "vehicle.mass=uniform(10.0,10.8)", "--report"]
    run_command(*command, "c.html", code=0, folder=tmp_path)
    assert '"text":"vehicle.mass [kg]"' in page_text(tmp_path / "c.html")
    run_command(*command, "c.pdf", code=0, folder=tmp_path)
    assert (tmp_path / "c.pdf").read_bytes().count(b"/MediaBox [ 0 0 595.44 841.68 ]") >= 2


def undescribed(schema, node, path=""):
    """Yield the paths of properties without a description beyond a unit, as often as an alternative has them."""
    node = dereference(schema, node)
    for name, value in node.get("properties", {}).items():
        text = dereference(schema, value).get("description", "")
        if "const" not in value and not re.sub(r"\[[^\]]*\]", "", text).strip():
            yield f"{path}.{name}"
        yield from undescribed(schema, value, f"{path}.{name}")
    inner = [node[key] for key in ("items", "then", "additionalProperties") if isinstance(node.get(key), dict)]
    for other in (*inner, *node.get("anyOf", ()), *node.get("oneOf", ()), *node.get("allOf", ())):
        yield from undescribed(schema, other, path)


@pytest.mark.parametrize("kind", SCHEMAS)
def test_schema_describes_every_key(kind):
    schema = SCHEMAS[kind]()
    assert sorted(set(undescribed(schema, schema))) == []


def test_list_has_every_effect_and_key():
    done = CliRunner().invoke(app, ["effects", "--list"])
    assert done.exit_code == 0, done.output
    *lines, explanation = done.output.splitlines()
    assert explanation.startswith("Operations: in a step of RK4")
    assert [line.partition(":")[0] for line in lines if not line.startswith(" ")] == effects.names()
    assert [line for line in lines if line.endswith(": ")] == []
    costs = dict(re.findall(r"^(\w+): .+; adds (\d+) operations$", done.output, re.MULTILINE))
    assert effects.names() == sorted([*costs, "coaxial_interference"])  # the drone has no coaxial rotors
    assert (
        "coaxial_interference: Thrust loss of a rotor in the wake of a rotor above it; not counted, because"
        in done.output
    )
    # each of the four evaluations and the split of the step add three components to the wind, and rotate a force
    assert 4 * 3 <= int(costs["wind_constant"]) <= 5 * 9
    assert 4 * 15 <= int(costs["body_wrench"]) <= 5 * 24
    assert int(costs["wind_constant"]) < int(costs["body_drag"]) < int(costs["battery"]) < int(costs["dynamic_inflow"])


def test_every_preset_is_described():
    for name, (module, _) in sensor_tables().items():
        assert all(descriptions.presets(name, module).values()), name
