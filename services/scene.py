"""A scene: TOML -> frozen, validated settings. Errors name the file, the line, the key, and what was expected.

Each service declares the tables that it alone reads as `Section` classes in its own `config.py`, those that several
read in `services/sections.py`; the loader finds them there, so a scene's vocabulary is written down once. A service
gets its settings with `scene[SectionClass]`.
"""

import difflib
import importlib.util
import pkgutil
import re
import tomllib
from collections.abc import Iterable, Mapping
from functools import cache
from pathlib import Path
from typing import Any, ClassVar, TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError

import services

OVERRIDE_MARK = "# --set "  # begins the lines at the end of a recorded scene


class SceneError(ValueError):
    """A scene that cannot be flown; the text is one line for the user."""


class WrongKeyError(ValueError):
    """What a check finds wrong with a key of another table than its own."""

    def __init__(self, dotted: str, message: str):
        super().__init__(f"{dotted}: {message}")
        self.dotted, self.message = dotted, message


class Section(BaseModel):
    """A table of the scene file. Subclasses say `TABLE`, the table's name.

    Strict: TOML has types, so a number in quotes or `true` for 1.0 is a slip of the pen.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)
    TABLE: ClassVar[str]
    OPTIONAL: ClassVar[bool] = False  # whether a scene may do without it; `scene.has` says if it does

    def lookup(self, keys: list[str]) -> Any:
        """The value of a key of this table, or of a table within it."""
        value: Any = self
        for key in keys:
            value = getattr(value, key)
        return value

    def check(self, scene: "Scene") -> None:
        """Check what only the whole scene shows.

        Raises:
            ValueError: "key: what was wrong, what would be right", the key relative to this table.
        """


S = TypeVar("S", bound=Section)


class Scene:
    """A validated scene. `scene[Run]` is the table that the class `Run` declares."""

    def __init__(self, path: Path, text: str, tables: Mapping[type[Section], Section]):
        self.path = path
        self.text = text  # TOML with overrides applied, as recorded
        self._tables = dict(tables)

    def __getitem__(self, section: type[S]) -> S:
        return self._tables[section]  # type: ignore[return-value]

    def has(self, section: type[Section]) -> bool:
        """Whether there is this table: always, unless it is optional."""
        return section in self._tables

    def replaced(self, section: Section) -> "Scene":
        """The same scene with this table in the place of its own; not checked against the others."""
        return Scene(self.path, self.text, {**self._tables, type(section): section})

    @property
    def name(self) -> str:
        """The file's name without its ending."""
        return self.path.stem

    def tables(self, name: str) -> Mapping[str, Any]:
        """The tables inside a table whose keys are names, for example each sensor's of "sensors"."""
        return self._tables[sections()[name]].tables  # type: ignore[attr-defined]

    def lookup(self, dotted: str) -> Any:
        """The value of a dotted key, for example "sensors.imu.rate"."""
        table, *rest = dotted.split(".")
        return self._tables[sections()[table]].lookup(rest)


@cache
def model_names() -> list[str]:
    """The plant models that `vehicle.model` may name: the modules of the folder services/plant/models."""
    folder = Path(__file__).parent / "plant" / "models"
    return sorted(m.name for m in pkgutil.iter_modules([str(folder)]) if not m.name.startswith("_"))


@cache
def sections() -> dict[str, type[Section]]:
    """Every table that a scene may have, found in `sections`, in the services' `config` and in the plant's `models`."""
    packages = [f"services.{p.name}" for p in pkgutil.iter_modules(services.__path__) if p.ispkg]
    wanted = ["services.sections", *[f"{package}.config" for package in packages]]
    modules = [name for name in wanted if importlib.util.find_spec(name)]
    modules += [f"services.plant.models.{name}" for name in model_names()]
    found: dict[str, type[Section]] = {}
    for name in modules:
        for value in vars(importlib.import_module(name)).values():
            if isinstance(value, type) and issubclass(value, Section) and hasattr(value, "TABLE"):
                found[value.TABLE] = value
    return found


def load(path: str | Path, overrides: Iterable[str] = ()) -> Scene:
    """Read, override and validate a scene.

    Args:
        path: the scene's TOML file.
        overrides: "dotted.key=value" with a TOML value (a bare word counts as a string).

    Raises:
        SceneError: one line that says what is wrong and what would be right.
    """
    return parse(Path(path), _read(Path(path)), overrides)


def parse(path: Path, text: str, overrides: Iterable[str] = ()) -> Scene:
    """`load` of a scene's text; `path` says what it is called and what lies beside it."""
    try:
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise SceneError(f"{path}: not valid TOML: {error}") from None
    overrides = list(overrides)
    for override in overrides:
        _override(data, override)
    return _validate(path, text, overrides, data)


def recorded_data(text: str) -> dict[str, Any]:
    """The tables of a scene as a log carries it, with the overrides of its run applied.

    Raises:
        ValueError: not valid TOML.
    """
    data = tomllib.loads(text)
    for line in text.splitlines():
        if line.startswith(OVERRIDE_MARK):
            _override(data, line.removeprefix(OVERRIDE_MARK))
    return data


def recorded_scene(name: str, folder: Path, text: str) -> Scene:
    """The scene that a log carries, with the overrides of its run; what it names beside it is in `folder`.

    Raises:
        SceneError: it is no longer a sound scene.
    """
    lines = text.splitlines()
    overrides = [line.removeprefix(OVERRIDE_MARK) for line in lines if line.startswith(OVERRIDE_MARK)]
    plain = "\n".join(line for line in lines if not line.startswith(OVERRIDE_MARK))
    return parse(folder / f"{name}.toml", plain, overrides)


def _read(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except IsADirectoryError:
        raise SceneError(f"{path}: is a folder; expected a scene file (TOML)") from None
    except UnicodeDecodeError:
        raise SceneError(f"{path}: not valid TOML: not a UTF-8 text file") from None
    except OSError as error:
        near = difflib.get_close_matches(path.name, [p.name for p in path.parent.glob("*.toml")], n=1)
        hint = f"; did you mean {path.parent / near[0]}?" if near else "; `lapwing scenes` lists those there are"
        raise SceneError(f"{path}: {(error.strerror or 'cannot be read').lower()}{hint}") from None


def _override(data: dict[str, Any], override: str) -> None:
    dotted, equals, value = override.partition("=")
    dotted, value = dotted.strip(), value.strip()
    if not equals or not dotted or not value:
        raise SceneError(f"--set {override}: expected KEY=VALUE, for example solver.step=0.001")
    try:
        parsed = tomllib.loads(f"value = {value}")["value"]
    except tomllib.TOMLDecodeError:
        if not re.fullmatch(r"[\w./+-]+", value):
            raise SceneError(f"--set {override}: {value} is not a TOML value; quote a text") from None
        parsed = value  # a bare word, as one types it in a shell
    table: Any = data
    *parents, last = dotted.split(".")
    for parent in parents:
        if isinstance(table, list):
            table = table[_index(table, parent, override)]
        elif isinstance(table, dict):
            table = table.setdefault(parent, {})
    if isinstance(table, list):
        table[_index(table, last, override)] = parsed
    elif isinstance(table, dict):
        table[last] = parsed
    else:
        raise SceneError(f"--set {override}: {dotted.rpartition('.')[0]} is a value, not a table")


def _index(items: list, text: str, override: str) -> int:
    if not text.isdigit() or int(text) >= len(items):
        raise SceneError(f"--set {override}: expected an index from 0 to {len(items) - 1}, got {text}")
    return int(text)


def _validate(path: Path, text: str, overrides: list[str], data: dict[str, Any]) -> Scene:
    known = sections()

    def fail(dotted: str, message: str) -> SceneError:
        for key in (o.partition("=")[0].strip() for o in overrides):
            if f"{dotted}.".startswith(f"{key}."):
                return SceneError(f"--set {dotted}: {message}")
            if key.startswith(f"{dotted}."):
                return SceneError(f"--set {key}: {dotted}: {message}")
        line = _line_of(text, dotted)
        return SceneError(f"{path}{f':{line}' if line else ''}: {dotted}: {message}")

    for name in data:
        if name not in known:
            raise fail(name, _unknown("table", name, known))
    tables: dict[type[Section], Section] = {}
    for name, section in known.items():
        if section.OPTIONAL and name not in data:
            continue
        raw = data.get(name, {})
        if not isinstance(raw, dict):
            raise fail(name, f"expected a table [{name}], got {raw!r}")
        try:
            tables[section] = section.model_validate(raw)
        except ValidationError as error:
            # A misspelt key also leaves another one missing: name the misspelling.
            first = min(error.errors(), key=lambda e: e["type"] != "extra_forbidden")
            raise fail(*_explain(name, section, first)) from None
    merged = text if not overrides else text + "".join(f"\n{OVERRIDE_MARK}{o}" for o in overrides) + "\n"
    scene = Scene(path, merged, tables)
    for section in tables:
        try:
            scene[section].check(scene)
        except WrongKeyError as error:
            raise fail(error.dotted, error.message) from None
        except SceneError:
            raise
        except ValueError as error:
            key, _, message = str(error).partition(": ")
            raise fail(f"{section.TABLE}.{key}", message) from None
    return scene


def _explain(name: str, section: type[Section], error: Any) -> tuple[str, str]:
    """The dotted key and a sentence for one of pydantic's errors."""
    location = [str(part) for part in error["loc"] if part != "[key]"]  # [key]: the key itself is at fault
    dotted = ".".join([name, *location])
    kind, value, context = error["type"], error["input"], error.get("ctx", {})
    if kind == "missing":
        return dotted, f"missing; expected {_expected(section, location)}"
    if kind == "extra_forbidden":
        return dotted, _unknown("key", location[-1], _keys(section, location[:-1]))
    message = error["msg"].removeprefix("Value error, ").removeprefix("Input should be ").removeprefix("a valid ")
    if kind == "value_error":
        return dotted, message
    if kind in _LIMITS:
        message = f"a number {_LIMITS[kind]} {context[_LIMIT_KEYS[kind]]:g}"
    elif kind == "too_short":
        message = f"at least {context['min_length']} of them"
    elif kind == "string_pattern_mismatch":
        message = f"a text of the form {context['pattern']}"
    else:
        message = _TYPES.get(kind, message)
    return dotted, f"expected {message}, got {value!r}"


_LIMIT_KEYS = {"greater_than": "gt", "greater_than_equal": "ge", "less_than": "lt", "less_than_equal": "le"}
_LIMITS = dict(zip(_LIMIT_KEYS, ("above", "not below", "below", "not above"), strict=True))
_TYPES = {"float_type": "a number", "int_type": "a whole number", "string_type": "a text", "bool_type": "true or false"}


def _model(section: type[BaseModel], location: list[str]) -> type[BaseModel] | None:
    """The model that `location` leads to, None where it cannot be followed."""
    model: Any = section
    for part in location:
        if part.isdigit():
            continue  # an entry of a list: the list's field has told its model
        found = _models(getattr(model.model_fields.get(part), "annotation", None))
        if not found:
            return None
        model = found[0]
    return model


def _models(annotation: Any) -> list[type[BaseModel]]:
    """The models that an annotation names, also inside of tuples and unions."""
    if hasattr(annotation, "model_fields"):
        return [annotation]
    return [model for argument in getattr(annotation, "__args__", ()) for model in _models(argument)]


def _keys(section: type[BaseModel], location: list[str]) -> list[str]:
    """The keys of the table that `location` leads to, as far as it can be followed."""
    model = _model(section, location)
    return list(model.model_fields) if model else []


def _expected(section: type[BaseModel], location: list[str]) -> str:
    model = _model(section, location[:-1])
    annotation = getattr(model.model_fields.get(location[-1]), "annotation", None) if model else None
    if _models(annotation):
        return f"a table [[{'.'.join([section.TABLE, *location])}]]"  # type: ignore[attr-defined]
    names: dict[Any, str] = {float: "a number", int: "a whole number", str: "a text", bool: "true or false"}
    return names.get(annotation, "a value")


def _unknown(what: str, name: str, choices: Iterable[str]) -> str:
    choices = sorted(choices)
    near = difflib.get_close_matches(name, choices, n=1)
    listed = f" ({what}s: {', '.join(choices)})" if choices else ""
    return f"unknown {what}{f'; did you mean {near[0]}?' if near else ''}{listed}"


def _line_of(text: str, dotted: str) -> int | None:
    """The line of a dotted key in TOML text, or of the nearest table around it, where a plain search finds it."""
    table = ""
    entries: dict[str, int] = {}  # how many entries of each array of tables have begun
    best, found = 0, None
    for number, line in enumerate(text.splitlines(), 1):
        if header := re.match(r"\s*(\[\[?)\s*([\w.]+)\s*\]", line):
            table = header[2]
            if header[1] == "[[":
                entries[table] = entries.get(table, -1) + 1
                table = f"{table}.{entries[table]}"
            full = table
        elif key := re.match(r"\s*([\w.]+)\s*=", line):
            full = f"{table}.{key[1]}" if table else key[1]
        else:
            continue
        if f"{dotted}.".startswith(f"{full}.") and len(full) > best:
            best, found = len(full), number
    return found
