"""Phases of a trajectory with the segments of each channel."""

from typing import Annotated

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, SerializeAsAny, ValidationError, model_validator

from lapwing.dynamics.config_error import ConfigError
from lapwing.dynamics.validation import fault
from lapwing.services.trajectory.segments import choose
from lapwing.services.trajectory.segments.segment import Positive, Segment
from lapwing.services.trajectory.user_segment import UserSegment


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


class Phase(BaseModel):
    """A named part of the trajectory."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    name: Annotated[str, Field(min_length=1)]  # shown in status and reports
    duration: Positive | None = None  # [s] default: duration of the longest channel
    x: Segments = ()  # [m]
    y: Segments = ()  # [m]
    z: Segments = ()  # [m]
    yaw: Segments = ()  # [rad]
    release: bool = False  # release the payload in this phase once the vehicle rests on the ground


class Phases(BaseModel):
    """All phases of a trajectory in order."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    phase: Annotated[tuple[Phase, ...], Field(min_length=1, strict=False)]  # in the order of flight

    @model_validator(mode="after")
    def _names_are_unique(self) -> "Phases":
        names = [phase.name for phase in self.phase]
        duplicates = sorted({name for name in names if names.count(name) > 1})
        if duplicates:
            raise ConfigError("phase", f"two phases are named {duplicates[0]!r}; use unique names")
        return self
