"""Validated scene, its tables, and the vocabulary of tables that a scene may have."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType
from typing import Any, ClassVar, NamedTuple, TypeVar

from lapwing.cosim.scene.files import Files
from lapwing.cosim.scene.overrides import Override
from lapwing.cosim.scene.scene_error import KeyOrigin, SceneError
from lapwing.dynamics.config_error import ConfigError
from lapwing.dynamics.validation import Table


class SceneTable(Table):
    """Table of a scene. Subclasses set `TABLE`, the name of the table."""

    TABLE: ClassVar[str]
    OPTIONAL: ClassVar[bool] = False  # True if a scene may omit it; see `Scene.has`
    FROM_FILE: ClassVar[bool] = False  # True if its content is that of a file that another table names
    SHARED: ClassVar[bool] = False  # True if all vehicles of a scene share it
    DISTINCT: ClassVar[str] = ""  # key whose value must differ between vehicles

    @classmethod
    def embed(cls, tree: dict[str, Any], files: Files) -> None:
        """Insert the content of each file that this table names into the scene's data, which is not validated yet.

        Raises:
            ConfigError: a file is missing or invalid.
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
        """Check the table against the other tables of the scene.

        Raises:
            ConfigError: with the path of the key in the scene.
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


class _CachedResult(NamedTuple):
    """Result of a function of a scene, and the tables that the function has read."""

    value: Any
    read: set[type[SceneTable] | None]


class Scene:
    """Validated scene. `scene[Run]` is the table that the class `Run` declares."""

    def __init__(
        self,
        path: Path,
        tables: Mapping[type[SceneTable], SceneTable],
        vocabulary: Vocabulary,
        sources: Mapping[str, bytes] | None = None,
        file_overrides: tuple[Override, ...] | None = None,
        locate: Callable[[str], tuple[str, KeyOrigin]] | None = None,
        vehicles: Sequence["Scene"] = (),
    ):
        self.path = path  # file of the scene
        self.sources = dict(sources or {})  # contents of all files that were read, by file name: airframe.toml
        self.file_overrides = file_overrides  # overrides of the file; None if the scene has other changes
        self.vehicles = tuple(vehicles)  # scene of each vehicle of several; own tables are then the shared ones
        self._locate = locate  # returns the key in the file, and the origin of its value
        self._tables = dict(tables)
        self._vocabulary = vocabulary
        self._cached: dict[Callable[[Scene], Any], _CachedResult] = {}
        self._reading: list[set[type[SceneTable] | None]] = []  # tables that the running functions have read

    def cached(self, function: Callable[["Scene"], T]) -> T:
        """Return the result of a function of the scene; it is called once, and its result is kept.

        The function may read the tables only, by `[]`, `has`, `section`, `tables` and `lookup`.
        """
        result = self._cached.get(function)
        if result is None:
            self._reading.append(set())
            try:
                value = function(self)
            finally:
                read = self._reading.pop()
            result = self._cached[function] = _CachedResult(value, read)
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
            expected = "a scene with one vehicle"
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
        """Return the scene with another version of a table, which is not checked against the other tables.

        Raises:
            SceneError: each of several vehicles has its own; see `with_vehicles`.
        """
        if self.vehicles and not section.SHARED:
            message = f"each of the {len(self.vehicles)} vehicles has its own"
            raise SceneError(section.TABLE, message, "the table of a scene with one vehicle", KeyOrigin(self.path))
        tables = {**self._tables, type(section): section}
        vehicles = [vehicle.replaced(section) for vehicle in self.vehicles]
        scene = Scene(self.path, tables, self._vocabulary, self.sources, locate=self._locate, vehicles=vehicles)
        scene._cached = {
            function: result for function, result in self._cached.items() if type(section) not in result.read
        }
        return scene

    @property
    def each_vehicle(self) -> tuple["Scene", ...]:
        """Scene of each vehicle; of a single vehicle the scene itself."""
        return self.vehicles or (self,)

    def with_vehicles(self, vehicles: Sequence["Scene"]) -> "Scene":
        """Return the scene with another version of each vehicle; the tables that all share are those of the scene."""
        return Scene(self.path, self._tables, self._vocabulary, self.sources, locate=self._locate, vehicles=vehicles)

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
        """Overrides as texts KEY=VALUE."""
        return tuple(override.text for override in self.file_overrides or ())

    @property
    def name(self) -> str:
        """File name without its extension."""
        return self.path.stem

    @property
    def resolved(self) -> dict[str, Any]:
        """The scene and its files as dicts, lists, texts and numbers; `from_resolved` restores it."""
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
