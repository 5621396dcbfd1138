"""Scenes by their names in addresses, and posted forms."""

from collections.abc import Iterable, Mapping
from functools import cache
from pathlib import Path
from urllib.parse import parse_qsl

from starlette.exceptions import HTTPException
from starlette.requests import Request

from lapwing.cosim.scene import Scene, SceneError
from lapwing.file_schemas.annotations import Schema
from lapwing.file_schemas.json_schema import scene_schema
from lapwing.services.common.run_schema import SHIPPED
from lapwing.services.scene_resolver import load, resolve
from lapwing.studio.form_fields import form
from lapwing.studio.scene_changes import Change, changes

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


def tables(keys: Iterable[str]) -> list[Change]:
    """Return the changes that add tables."""
    return [Change(key, {}) for key in keys]


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
            before, remaining = remaining, [change for change in remaining if change.key != error.key]
            if error.key not in fields or len(remaining) == len(before):
                return changed, faults, message
            faults[error.key] = error.sentence
