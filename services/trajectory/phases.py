"""Phases of a trajectory with the segments of each channel."""

import importlib
from collections.abc import Iterator
from types import ModuleType
from typing import Annotated, Any

from pydantic import BeforeValidator, ConfigDict, Field, SerializeAsAny, ValidationError, model_validator

from lapwing.cosim.config.user_module import FAULTS, blame
from lapwing.cosim.scene import Scene
from lapwing.dynamics.config_error import ConfigError
from lapwing.dynamics.validation import Table, fault
from lapwing.services.common import user_code, user_modules
from lapwing.services.trajectory.polynomial_piece import Piece
from lapwing.services.trajectory.segments import KINDS, choose
from lapwing.services.trajectory.segments.segment import Positive, Segment


def _segment(table: object) -> Segment:
    if not isinstance(table, dict) or "module" not in table:
        return choose(table)
    try:
        return UserSegment.model_validate(table)
    except ValidationError as error:
        raise fault(error, UserSegment) from None


def _segments(value: object) -> tuple[Segment, ...]:
    if not isinstance(value, list | tuple):
        return (_segment(value),)
    segments = []
    for number, table in enumerate(value):
        try:
            segments.append(_segment(table))
        except ConfigError as error:
            raise error.with_prefix(str(number)) from None
    return tuple(segments)


Segments = Annotated[tuple[SerializeAsAny[Segment], ...], BeforeValidator(_segments)]


class Phase(Table):
    """A named part of the trajectory."""

    model_config = ConfigDict(strict=False)

    name: Annotated[str, Field(min_length=1)]  # shown in status and reports
    duration: Positive | None = None  # [s] default: duration of the longest channel
    x: Segments = ()  # [m]
    y: Segments = ()  # [m]
    z: Segments = ()  # [m]
    yaw: Segments = ()  # [rad]
    release: bool = False  # release the payload in this phase once the vehicle rests on the ground


class Phases(Table):
    """All phases of a trajectory in order."""

    model_config = ConfigDict(strict=False)

    phase: Annotated[tuple[Phase, ...], Field(min_length=1, strict=False)]  # in the order of flight

    @model_validator(mode="after")
    def _names_are_unique(self) -> "Phases":
        names = [phase.name for phase in self.phase]
        duplicates = sorted({name for name in names if names.count(name) > 1})
        if duplicates:
            raise ConfigError("phase", f"two phases are named {duplicates[0]!r}; use unique names")
        return self


class UserSegment(Segment):
    """Segment whose class is in a user module. The module is imported when the trajectory is compiled."""

    model_config = ConfigDict(frozen=True, extra="allow")
    kind: str
    module: str

    def pieces(self, start: float) -> list[Piece]:
        """Return the pieces of the user's segment. Raise ConfigError if its class, keys or pieces are invalid."""
        result = self._call("pieces", start)
        valid = isinstance(result, list) and all(isinstance(p, Piece) and len(p.polynomial) <= 6 for p in result)
        if not valid:
            raise ConfigError(
                "module", f"pieces of {self.kind} returns {result!r}", "a list of Piece with 6 numbers at most"
            )
        return result

    def end(self, start: float) -> float:
        """Return the value at the end of the user's segment [u]."""
        return float(self._call("end", start))

    def _call(self, method: str, start: float) -> Any:
        module = importlib.import_module(self.module)
        segment = self._segment(module)
        try:
            return getattr(segment, method)(start)
        except ConfigError:
            raise
        except FAULTS as error:
            raise ConfigError("module", f"{self.module}: {blame(error, module)}") from error

    def _segment(self, module: ModuleType) -> Segment:
        if self.kind in KINDS:
            raise ConfigError("kind", f"{self.kind} is the name of a built-in kind", "another name")
        classes = [
            c for c in vars(module).values() if isinstance(c, type) and issubclass(c, Segment) and c is not Segment
        ]
        kinds = {cls.kind_name(): cls for cls in classes}
        if self.kind not in kinds:
            raise ConfigError.unknown("kind", f"kind of segment in {self.module}", self.kind, kinds)
        try:
            return kinds[self.kind].model_validate({"kind": self.kind, **(self.__pydantic_extra__ or {})})
        except ValidationError as error:
            raise fault(error, kinds[self.kind]) from None


def load(scene: Scene, segments: Iterator[tuple[str, Segment]]) -> None:
    """Import the modules of user segments; raise ConfigError if one cannot be imported.

    Args:
        scene: scene with the modules' texts.
        segments: pairs of scene key and segment.
    """
    texts = user_modules.texts(scene)
    for key, segment in segments:
        if isinstance(segment, UserSegment):
            user_code.load_module(f"{key}.module", segment.module, texts)
