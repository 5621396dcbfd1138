"""The `[formation]` table of a scene: load path, link directions and gains."""

from typing import ClassVar

from pydantic import Field

from lapwing.cosim.scene import Scene, SceneTable
from lapwing.dynamics.config_error import ConfigError
from lapwing.services.common.schemas.run_schema import CooperativeLoad, Triple


class Formation(SceneTable):
    """Control of load position, link directions and attitudes (theory, eqs. (7.22) to (7.27))."""

    TABLE: ClassVar[str] = "formation"
    OPTIONAL: ClassVar[bool] = True
    path: tuple[Triple, Triple, Triple] = Field(strict=False)  # [m], [m/s], [m/s^2] load path c0 + c1 t + c2 t^2, world
    link_direction: tuple[Triple, ...] = Field(strict=False)  # desired, from quadrotor to load; any non-zero length
    load_position: float = Field(ge=0.0)  # [1/s^2] gain
    load_velocity: float = Field(ge=0.0)  # [1/s] gain
    link: float = Field(ge=0.0)  # [1/s^2] gain of the links' direction
    link_rate: float = Field(ge=0.0)  # [1/s] gain
    attitude: float = Field(ge=0.0)  # [N m] gain, over epsilon^2
    attitude_rate: float = Field(ge=0.0)  # [N m s] gain, over epsilon
    epsilon: float = Field(gt=0.0)  # time-scale separation of the attitude loop

    def check(self, scene: Scene) -> None:
        """Raise ConfigError unless there is a load and a direction for every link."""
        if not scene.has(CooperativeLoad):
            raise ConfigError("cooperative_load", "missing", "a table [cooperative_load] for the formation")
        n = len(scene[CooperativeLoad].link_length)
        if len(self.link_direction) != n or not all(any(d) for d in self.link_direction):
            expected = f"{n} non-zero directions, one for each link"
            raise ConfigError("formation.link_direction", f"got {list(self.link_direction)}", expected)
