"""Generate the reference pages of commands, scenes, airframes and gain sets (run by `mkdocs build`)."""

import json
from collections.abc import Iterator
from typing import Any

import mkdocs_gen_files
import typer
from typer.cli import get_docs_for_click

from lapwing.cli.main import app
from lapwing.file_schemas.json_schema import SCHEMAS

INTRODUCTION = {
    "scene": "A scene is a TOML file. Override any key with `--set KEY=VALUE`, for example "
    "`--set airframe.mass.total=9.5`. A table that a scene does not name is not simulated and costs nothing. "
    "`lapwing schema` writes the JSON schema for [editors](../guides/editors.md).",
    "airframe": "A TOML file that `vehicle.airframe` names. [Your own airframe](../guides/new_airframe.md) describes "
    "how to measure the numbers.",
    "gains": "A TOML file that `autopilot.gains` names.",
}


def _type(schema: dict[str, Any]) -> str:
    if "enum" in schema:
        return ", ".join(f"`{json.dumps(value)}`" for value in schema["enum"])
    if "anyOf" in schema:
        return " or ".join(dict.fromkeys(_type(choice) for choice in schema["anyOf"]))
    if "$ref" in schema:
        return schema["$ref"].rpartition("/")[2]
    if schema.get("type") == "array":
        return f"list of {_type(schema['items'])}" if isinstance(schema.get("items"), dict) else "list"
    return str(schema.get("type", "any"))


def _range(schema: dict[str, Any]) -> str:
    parts = [
        f"{sign} {schema[key]:g}"
        for key, sign in (("minimum", ">="), ("exclusiveMinimum", ">"), ("maximum", "<="), ("exclusiveMaximum", "<"))
        if key in schema
    ]
    return ", ".join(parts)


def _cell(text: str) -> str:
    return " ".join(text.split()).replace("|", "\\|")


def _tables(schema: dict[str, Any], path: str, level: int) -> Iterator[str]:
    """Yield a section for a table of keys, and one for each table within it."""
    properties = schema.get("properties", {})
    if description := schema.get("description"):
        yield description
    inner = {name: sub for name, sub in properties.items() if _is_table(sub)}
    required = schema.get("required", [])
    rows = [
        [f"`{name}`", _type(sub), _range(sub), _default(sub, name in required), _cell(sub.get("description", ""))]
        for name, sub in properties.items()
        if name not in inner
    ]
    if rows:
        head = ["key", "type", "range", "default", "meaning"]
        lines = [head, ["---"] * len(head), *rows]
        yield "\n".join(f"| {' | '.join(row)} |" for row in lines)
    for name, sub in inner.items():
        where = f"{path}.{name}" if path else name
        table = _is_table(sub)
        yield f"{'#' * min(level, 5)} {'[[' + where + ']]' if sub.get('type') == 'array' else '[' + where + ']'}"
        yield from _tables({"description": sub.get("description", ""), **table}, where, level + 1)


def _is_table(schema: dict[str, Any]) -> dict[str, Any]:
    """Return the object schema that a property is, contains in a list, or offers first; {} if there is none."""
    choices = [schema, *schema.get("anyOf", []), *([schema["items"]] if isinstance(schema.get("items"), dict) else [])]
    return next((choice for choice in choices if choice.get("properties")), {})


def _default(schema: dict[str, Any], required: bool) -> str:
    if "default" in schema:
        return f"`{json.dumps(schema['default'])}`"
    return "required" if required else ""


for kind, title in (("scene", "Scene files"), ("airframe", "Airframe files"), ("gains", "Gain sets")):
    with mkdocs_gen_files.open(f"reference/{kind}.md", "w") as page:
        page.write("\n\n".join([f"# {title}", INTRODUCTION[kind], *_tables(SCHEMAS[kind](), "", 2)]) + "\n")

command = typer.main.get_command(app)
with mkdocs_gen_files.open("reference/commands.md", "w") as page:
    text = get_docs_for_click(obj=command, ctx=typer.Context(command), name="lapwing")
    page.write(text.replace("# `lapwing`", "# Commands", 1))
