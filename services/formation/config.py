"""The `[formation]` of a scene: where the load should go, how the links should hang, and the gains."""

from typing import ClassVar

from pydantic import Field

from services.scene import Scene, Section
from services.sections import CooperativeLoad, Triple


class Formation(Section):
    """Load tracking, link directions and attitudes (theory.md, eqs. (7.22) to (7.27))."""

    TABLE: ClassVar[str] = "formation"
    OPTIONAL: ClassVar[bool] = True
    path: tuple[Triple, Triple, Triple] = Field(strict=False)  # load position: [0] + [1] t + [2] t^2 [m], world frame
    link_direction: tuple[Triple, ...] = Field(strict=False)  # wanted, from quadrotor to load; any length but zero
    load_position: float = Field(ge=0.0)  # gain [1/s^2]
    load_velocity: float = Field(ge=0.0)  # gain [1/s]
    link: float = Field(ge=0.0)  # gain of the links' direction [1/s^2]
    link_rate: float = Field(ge=0.0)  # gain [1/s]
    attitude: float = Field(ge=0.0)  # gain [N m], over epsilon^2
    attitude_rate: float = Field(ge=0.0)  # gain [N m s], over epsilon
    epsilon: float = Field(gt=0.0)  # makes the attitude loop faster than the others

    def check(self, scene: Scene) -> None:
        """A direction for every link, and a load to control."""
        if not scene.has(CooperativeLoad):
            raise ValueError("path: a formation needs a table [cooperative_load]")
        n = len(scene[CooperativeLoad].link_length)
        if len(self.link_direction) != n or not all(any(d) for d in self.link_direction):
            raise ValueError(f"link_direction: expected {n} directions that are not zero, one for each link")
