"""Every table, key and preset of a scene, airframe or gain set has a description, in schemas and in the list."""

import re

import pytest
from typer.testing import CliRunner

from lapwing.cli.main import app
from lapwing.dynamics import effects
from lapwing.file_schemas import descriptions
from lapwing.file_schemas.annotations import dereference
from lapwing.file_schemas.json_schema import SCHEMAS, sensor_tables


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
    lines = done.output.splitlines()
    assert [line.partition(":")[0] for line in lines if not line.startswith(" ")] == effects.names()
    assert "wind_gust: Single discrete gust" in lines
    assert [line for line in lines if line.endswith(": ")] == []


def test_every_preset_is_described():
    for name, (module, _) in sensor_tables().items():
        assert all(descriptions.presets(name, module).values()), name
