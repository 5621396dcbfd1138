"""The `[trajectory]` of a scene: named phases, in each the segments of the channels that move.

```toml
[[trajectory.phase]]
name = "climb"
z = { kind = "ramp", to = 10.0, rate = 1.0 }

[[trajectory.phase]]
name = "hover"
duration = 5.0
```

Values are displacements from the vehicle's pose at the start, in world axes: z = 0 stands on the ground again.
A channel that a phase does not name holds. A channel may have a list of segments, joined in time. A phase lasts
`duration`, or else as long as its longest channel; channels that end earlier hold.
"""

from typing import Annotated, ClassVar

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, SerializeAsAny, model_validator

from services.scene import Scene, Section
from services.trajectory.segments import choose
from services.trajectory.segments.segment import Positive, Segment


def _segments(value: object) -> tuple[Segment, ...]:
    items = value if isinstance(value, (list, tuple)) else (value,)
    return tuple(choose(item) for item in items)


Segments = Annotated[tuple[SerializeAsAny[Segment], ...], BeforeValidator(_segments)]


class Phase(BaseModel):
    """A named stretch of the flight."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    name: Annotated[str, Field(min_length=1)]
    duration: Positive | None = None  # [s]
    x: Segments = ()  # [m]
    y: Segments = ()  # [m]
    z: Segments = ()  # [m]
    yaw: Segments = ()  # [rad]


class Trajectory(Section):
    """What the vehicle is asked to fly."""

    TABLE: ClassVar[str] = "trajectory"
    OPTIONAL: ClassVar[bool] = True

    phase: Annotated[tuple[Phase, ...], Field(min_length=1, strict=False)]

    @model_validator(mode="after")
    def _names_once(self):
        names = [phase.name for phase in self.phase]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise ValueError(f"two phases are named {twice[0]!r}; a name is used once")
        return self

    def check(self, scene: Scene) -> None:
        """The segments join, phases are long enough, tables can be read."""
        from services.trajectory.mission import compile  # here: mission itself needs this module

        try:
            compile(self, folder=scene.path.parent)
        except ValueError as error:
            raise ValueError(f"phase: {error}") from None
