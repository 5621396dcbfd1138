"""A validated scene, the tables that it consists of, and the vocabulary of tables that there are."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType
from typing import Any, ClassVar, NamedTuple, TypeVar

from pydantic import BaseModel, ConfigDict

from lapwing.cosim.scene.files import Files
from lapwing.cosim.scene.overrides import Override
from lapwing.cosim.scene.scene_error import KeyOrigin, SceneError
from lapwing.dynamics.config_error import ConfigError


class SceneTable(BaseModel):
    """A table of the scene. Subclasses say `TABLE`, the table's name.

    Strict: TOML has types, so a number in quotes or `true` for 1.0 is a slip of the pen.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)
    TABLE: ClassVar[str]
    OPTIONAL: ClassVar[bool] = False  # whether a scene may do without it; `scene.has` says if it does
    FROM_FILE: ClassVar[bool] = False  # whether its content is that of a file which another table names
    SHARED: ClassVar[bool] = False  # whether all vehicles of a scene have it in common
    DISTINCT: ClassVar[str] = ""  # its key of which each of several vehicles has another value

    @classmethod
    def embed(cls, tree: dict[str, Any], files: Files) -> None:
        """Put the content of every file that this table names into the scene's data, not yet validated.

        Raises:
            KeyedError: no such file, or its content is not of the right form.
        """

    @classmethod
    def defaults_of(cls, i: int) -> dict[str, Any]:
        """Return the defaults that depend on the number `i` (from 0) of the vehicle."""
        return {}

    def resolved(self) -> dict[str, Any]:
        """Return all keys, including defaults, as plain data that validates to the same table."""
        return self.model_dump(exclude_none=True)

    def lookup(self, keys: list[str]) -> Any:
        """Return the value of a key of this table, or of a table within it."""
        value: Any = self
        for key in keys:
            value = getattr(value, key)
        return value

    def check(self, scene: "Scene") -> None:
        """Check what only the whole scene shows.

        Raises:
            KeyedError: with the key's path in the scene.
        """


class Vocabulary(NamedTuple):
    """Tables that a scene may have, by name, and checks across tables."""

    sections: Mapping[str, type[SceneTable]]
    checks: tuple[Callable[["Scene"], None], ...] = ()

    @classmethod
    def of(cls, modules: Iterable[ModuleType], *checks: Callable[["Scene"], None]) -> "Vocabulary":
        """Return the vocabulary of the tables that some modules declare or import."""
        result = [value for module in modules for value in vars(module).values()]
        sections = [v for v in result if isinstance(v, type) and issubclass(v, SceneTable) and hasattr(v, "TABLE")]
        return cls({section.TABLE: section for section in sections}, checks)


S = TypeVar("S", bound=SceneTable)
T = TypeVar("T")


class _Found(NamedTuple):
    """Result of a function of a scene, and the tables that it has read."""

    value: Any
    read: set[type[SceneTable] | None]


class Scene:
    """A validated scene. `scene[Run]` is the table that the class `Run` declares. It opens no file."""

    def __init__(
        self,
        path: Path,
        tables: Mapping[type[SceneTable], SceneTable],
        vocabulary: Vocabulary,
        sources: Mapping[str, bytes] | None = None,
        given: tuple[Override, ...] | None = None,
        locate: Callable[[str], tuple[str, KeyOrigin]] | None = None,
        vehicles: Sequence["Scene"] = (),
    ):
        self.path = path  # where it was read from
        self.sources = dict(sources or {})  # every file that was read, by file name: airframe.toml
        self.given = given  # overrides; None where the scene is more than its file and these
        self.vehicles = tuple(vehicles)  # a scene of each vehicle, where the file lists them; its own tables are common
        self._locate = locate  # returns the key in the file, and the origin of its value
        self._tables = dict(tables)
        self._vocabulary = vocabulary
        self._found: dict[Callable[[Scene], Any], _Found] = {}
        self._reading: list[set[type[SceneTable] | None]] = []  # the tables that functions under way have asked for

    def cached(self, of: Callable[["Scene"], T]) -> T:
        """Return the result of a function of the scene; it is called once, and its result is kept.

        The function may read the tables only, by `[]`, `has`, `section`, `tables` and `lookup`.
        """
        result = self._found.get(of)
        if result is None:
            self._reading.append(set())
            try:
                value = of(self)
            finally:
                read = self._reading.pop()
            result = self._found[of] = _Found(value, read)
        if self._reading:
            self._reading[-1] |= result.read
        return result.value

    def __getitem__(self, section: type[S]) -> S:
        return self._known(section)._tables[section]  # type: ignore[return-value]

    def _known(self, section: type[SceneTable] | None) -> "Scene":
        """Return this scene; raise SceneError for a table that each of several vehicles has separately."""
        if self._reading:
            self._reading[-1].add(section)
        if self.vehicles and section is not None and not section.SHARED:
            expected = "a scene of one vehicle, which is all that can be used here"
            raise SceneError("vehicle", f"there are {len(self.vehicles)}", expected, KeyOrigin(self.path))
        return self

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Scene) and (self.name, self._tables, self.vehicles) == (
            other.name,
            other._tables,
            other.vehicles,
        )

    __hash__ = None  # type: ignore[assignment]

    def has(self, section: type[SceneTable] | str) -> bool:
        """Return True if the scene has this table, given by its class or name; only optional tables can be missing."""
        known = self._vocabulary.sections.get(section) if isinstance(section, str) else section
        return known in self._known(known)._tables

    def replaced(self, section: SceneTable) -> "Scene":
        """Return the scene with another version of a table, which is not checked against the other tables."""
        tables = {**self._tables, type(section): section}
        vehicles = [vehicle.replaced(section) for vehicle in self.vehicles]
        scene = Scene(self.path, tables, self._vocabulary, self.sources, locate=self._locate, vehicles=vehicles)
        scene._found = {of: result for of, result in self._found.items() if type(section) not in result.read}
        return scene

    @contextmanager
    def located(self) -> Iterator[None]:
        """Add the origin of the key to a ConfigError that is raised within the context."""
        try:
            yield
        except SceneError:
            raise
        except ConfigError as error:
            key, source = self._locate(error.key) if self._locate else (error.key, KeyOrigin(self.path))
            raise SceneError(key, error.message, error.expected, source) from error.__cause__

    def __repr__(self) -> str:
        return f"<Scene {self.name}{''.join(f', {override}' for override in self.overrides)}>"

    @property
    def overrides(self) -> tuple[str, ...]:
        """KEY=VALUE, as given."""
        return tuple(override.text for override in self.given or ())

    @property
    def name(self) -> str:
        """The file's name without its ending."""
        return self.path.stem

    @property
    def resolved(self) -> dict[str, Any]:
        """Return the scene and its files as dicts, lists, texts and numbers; `from_resolved` restores it."""
        tables: dict[str, Any] = {section.TABLE: table.resolved() for section, table in self._tables.items()}
        if self.vehicles:
            tables["vehicle"] = [
                {name: table for name, table in scene.resolved.items() if name not in tables} for scene in self.vehicles
            ]
        return _plain({name: tables[name] for name in sorted(tables)})

    def section(self, name: str) -> Any:
        """Return a table by name, for callers that do not import its class."""
        return self[self._vocabulary.sections[name]]

    def tables(self, name: str) -> Mapping[str, Any]:
        """Return the subtables of a table whose keys are names, for example each sensor's of "sensors"."""
        return self.section(name).tables

    def lookup(self, dotted: str) -> Any:
        """Return the value of a dotted key, for example "sensors.imu.rate"."""
        table, *rest = dotted.split(".")
        return self.section(table).lookup(rest)


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, tuple | list):
        return [_plain(item) for item in value]
    return value
