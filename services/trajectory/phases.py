"""Phases of a flight: in each the segments of the channels that move."""

from typing import Annotated

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, SerializeAsAny, model_validator

from lapwing.dynamics.config_error import ConfigError
from lapwing.services.trajectory.segments import choose
from lapwing.services.trajectory.segments.segment import Positive, Segment


def _segments(value: object) -> tuple[Segment, ...]:
    if not isinstance(value, list | tuple):
        return (choose(value),)
    segments = []
    for number, table in enumerate(value):
        try:
            segments.append(choose(table))
        except ConfigError as error:
            raise error.under(str(number)) from None
    return tuple(segments)


Segments = Annotated[tuple[SerializeAsAny[Segment], ...], BeforeValidator(_segments)]


class Phase(BaseModel):
    """A named stretch of the flight."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    name: Annotated[str, Field(min_length=1)]  # told in the status, and in reports
    duration: Positive | None = None  # [s] as long as its longest channel if left out
    x: Segments = ()  # [m]
    y: Segments = ()  # [m]
    z: Segments = ()  # [m]
    yaw: Segments = ()  # [rad]
    release: bool = False  # whether the payload is let go of in this phase, as soon as the vehicle stands


class Phases(BaseModel):
    """All phases of a flight, in order."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    phase: Annotated[tuple[Phase, ...], Field(min_length=1, strict=False)]  # in the order in which they are flown

    @model_validator(mode="after")
    def _names_once(self) -> "Phases":
        names = [phase.name for phase in self.phase]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise ConfigError("phase", f"two phases are named {twice[0]!r}; a name is used once")
        return self
