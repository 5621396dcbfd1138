"""Scenes by their names in addresses, and posted forms."""

import re
import tomllib
from collections.abc import Iterable, Mapping
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple
from urllib.parse import parse_qsl

from starlette.exceptions import HTTPException
from starlette.requests import Request

from lapwing.cosim.diagram.multi_vehicle import members
from lapwing.cosim.scene import Scene, SceneError
from lapwing.cosim.scene.overrides import with_values
from lapwing.cosim.scene.toml_text import dump, toml
from lapwing.dynamics import units
from lapwing.file_schemas.annotations import Schema
from lapwing.file_schemas.json_schema import scene_schema
from lapwing.runs.scene_warnings import warnings
from lapwing.services.common.schemas.run_schema import SHIPPED
from lapwing.services.scene_resolver import load, resolve
from lapwing.services.trajectory.service import ordered_path
from lapwing.views.studio.form_fields import EXTENSIBLE, Field, form, starting_values

OFF, SWITCHED = "false", tuple(f"{name}." for name in EXTENSIBLE)  # value that switches an effect or sensor off
SPEEDS = ("1", "2", "5", "10", "max")  # selectable values of --speed


class Change(NamedTuple):
    """A key with its new value."""

    key: str
    value: Any

    @property
    def override(self) -> str:
        """Override KEY=VALUE, as for --set."""
        text = toml(self.value)
        if (
            isinstance(self.value, str)
            and re.fullmatch(r"[A-Za-z_][\w./:+-]*", self.value)
            and not _is_word(text[1:-1])
        ):
            text = self.value  # a bare word is a text
        return f"{self.key}={text}"


def changes(
    fields: Iterable[Field], posted: Mapping[str, str], added: Iterable[str]
) -> tuple[list[Change], dict[str, str]]:
    """Return the changes of a posted form, and the faults by key.

    Args:
        fields: fields of the form.
        posted: posted texts by key.
        added: keys of added tables.
    """
    off = [key for key, text in posted.items() if text == OFF and key.count(".") == 1 and key.startswith(SWITCHED)]
    result = [*tables(key for key in added if key not in off), *(Change(key, False) for key in off)]
    faults: dict[str, str] = {}
    for field in fields:
        text = posted.get(field.key, field.text).strip()
        if text in (field.text, "") or field.key.startswith(tuple(f"{key}." for key in off)):
            continue
        try:
            result.append(Change(field.key, _value(field, text)))
        except ValueError as error:
            faults[field.key] = str(error)
    return result, faults


def command_line(scene: str, changed: Iterable[Change], speed: str, view: bool) -> list[str]:
    """Return the words of the command that runs a scene with these changes."""
    words = ["lapwing", "run", scene]
    for change in merged(changed):
        words += ["--set", change.override]
    return [*words, *(["--speed", speed] if speed else []), *(["--view"] if view else [])]


def python(scene: str, changed: Iterable[Change]) -> str:
    """Return Python code that runs a scene with these changes."""
    lines = [f"    {change.key!r}: {change.value!r},\n" for change in merged(changed)]
    overrides = ", {\n" + "".join(lines) + "}" if lines else ""
    return f"import lapwing\n\nflight = lapwing.fly({scene!r}{overrides})\nprint(flight.outcome)\nflight.report()\n"


def merged(changed: Iterable[Change]) -> list[Change]:
    """Return changes that name an added table only where none of its keys is changed."""
    changes = list(changed)
    own = {change.key for change in changes}
    result = []
    for change in changes:
        if isinstance(change.value, dict) and any(key.startswith(f"{change.key}.") for key in own):
            rest = {f"{change.key}.{key}": value for key, value in change.value.items()}
            result += [Change(key, value) for key, value in rest.items() if key not in own]
        else:
            result.append(change)
    return result


def _value(field: Field, text: str) -> Any:
    """Return the value of a text in the form. Raise ValueError if it does not fit the field's kind."""
    if field.kind == "text" or (field.kind == "choice" and not _is_word(text)):
        return text
    unit = field.unit.replace("²", "^2").replace("³", "^3")
    if field.kind == "number" and units.parse(text, unit) is not None:
        return text  # with a unit
    try:
        (value,) = tomllib.loads(f"value = {text}").values()
    except (ValueError, RecursionError):  # invalid TOML, or more than one value
        known = f", or one with {', '.join(units.UNITS[unit])}" if unit in units.UNITS else ""
        number = {"number": f"a number{known}", "integer": "a whole number"}
        expected = number.get(field.kind, "a TOML value, e.g. [1.0, 2.0]")
        raise ValueError(f"got {text[:60]}; expected {expected}") from None
    if field.kind == "integer" and type(value) is not int:
        raise ValueError(f"got {text[:60]}; expected a whole number")
    if field.kind == "number":
        if type(value) not in (int, float):
            raise ValueError(f"got {text[:60]}; expected a number")
        value = float(value)
    return value


def _is_word(text: str) -> bool:
    """Return True if a bare word is a TOML value other than a text."""
    return text in ("true", "false", "inf", "nan")


MOST_PLACES = 300  # largest number of drawn places of a path, about
MOST_FIELDS = 5000  # largest number of fields of a posted form


@cache
def schema() -> Schema:
    """Return the schema of scenes, cached because it takes a second to build."""
    return scene_schema()


def scene_files() -> dict[str, Path]:
    """Return the paths of scenes by name: those in the working directory, and the included ones."""
    shipped = {path.stem: path for path in sorted(SHIPPED.glob("*.toml"))}
    own = {}
    for path in sorted(Path().glob("*.toml")):
        try:
            text = path.read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError):
            continue
        if "[vehicle" in text and "[run]" in text:
            own[path.name] = path
    return {**own, **shipped}


def load_named(name: str, changed: Iterable[Change] = ()) -> Scene:
    """Load a scene by the name in its address. Raise KeyError for an unknown one, SceneError for an invalid one."""
    files = scene_files()
    if name not in files:
        raise KeyError(name)
    return load(files[name], [change.override for change in changed])


def toml_text(name: str, changed: Iterable[Change]) -> str:
    """Return the changed values as tables of a scene file; a list with a changed entry is written as a whole."""
    tree = with_values(tomllib.loads(scene_files()[name].read_text("utf-8")), [change.override for change in changed])
    result: dict[str, Any] = {}
    for change in changed:
        source, target = tree, result
        *parents, last = change.key.split(".")
        for k, part in enumerate((*parents, last)):
            if k == len(parents) or not isinstance(source[part], Mapping):
                target[part] = source[part]
                break
            source, target = source[part], target.setdefault(part, {})
    return dump(result).strip()


def tables(keys: Iterable[str]) -> list[Change]:
    """Return the changes that add tables, with values of their required keys."""
    return [Change(key, starting_values(schema(), key)) for key in keys]


def paths_and_warnings(scene: Scene) -> tuple[list[list[tuple[float, ...]]], list[str]]:
    """Return the path that the trajectory of each vehicle orders, places [m], world; and the warnings of the scene."""
    result, config = [], resolve(scene)
    for member in members(config):
        if trajectory := ordered_path(member):
            places = (place for _, _, *place in trajectory.track(member.duration, MOST_PLACES))
            result.append([tuple(round(value, 2) for value in place) for place in places])
    return result, list(warnings(scene, config))


async def posted_form(request: Request) -> tuple[str, dict[str, str], tuple[str, ...]]:
    """Return the scene's name, the fields and the added tables of a form."""
    if request.headers.get("content-type", "").partition(";")[0] != "application/x-www-form-urlencoded":
        raise HTTPException(415, "expected a form; files cannot be uploaded")
    try:
        pairs = parse_qsl((await request.body()).decode(), keep_blank_values=True, max_num_fields=MOST_FIELDS)
    except ValueError:
        raise HTTPException(422, "the form cannot be read") from None
    added = tuple(dict.fromkeys(value for key, value in pairs if key == "add" and value))
    return request.path_params["name"], dict(pairs), added


def form_changes(
    name: str, posted: Mapping[str, str], added: tuple[str, ...]
) -> tuple[list[Change], dict[str, str], str]:
    """Return changes, faults by key, and a fault of the form; without faults the changed scene is valid."""
    try:
        fields = {f.key: f for group in form(load_named(name, tables(added)), schema()) for f in group.all_fields()}
    except SceneError as error:
        return [], {}, str(error)
    changed, faults = changes(fields.values(), posted, added)
    remaining, message = changed, ""
    while True:  # removes each faulty change, to find all faults
        try:
            resolve(load_named(name, remaining))
            return changed, faults, message
        except SceneError as error:
            message = message or str(error)
            key = next((key for key in fields if f"{error.key}.".startswith(f"{key}.")), "")
            before, remaining = remaining, [change for change in remaining if change.key != key]
            if len(remaining) == len(before):
                return changed, faults, message
            entry = error.key.removeprefix(key)  # of a list
            faults[key] = f"{key.rpartition('.')[2]}{entry}: {error.sentence}" if entry else error.sentence
