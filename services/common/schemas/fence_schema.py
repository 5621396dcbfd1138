"""The `[fence]` table of a scene: areas that vehicles must stay in, or keep out of.

```toml
[[fence.keep_in]]
corners = [[-5.0, -5.0], [30.0, -5.0], [30.0, 30.0], [-5.0, 30.0]]  # m

[[fence.keep_out]]
position = { latitude_deg = 40.7687, longitude_deg = 14.7909 }  # or [12.0, 4.0], m
radius = 3.0  # m
```

Lapwing's autopilot acts on a breach of the fence by its parameter FS_FENCE_ACT, and returns around it.
"""

from typing import Annotated, Any, ClassVar

from pydantic import Field

from lapwing.cosim.scene import Files, Scene, SceneTable
from lapwing.cosim.scene.files import unvalidated_value
from lapwing.dynamics.config_error import ConfigError
from lapwing.dynamics.validation import Table
from lapwing.messages import OperatorCommand, Vector3
from lapwing.services.common.firmware.schema import OWN, firmware_of, flown_by_firmware
from lapwing.services.common.plans.fence import Fence
from lapwing.services.common.plans.item_converters import new_item
from lapwing.services.common.schemas.environment_schema import Length, Pair
from lapwing.services.common.schemas.place_schema import world_place
from lapwing.services.common.schemas.vehicle_schema import start_place

SOURCE = "scene"
Corners = Annotated[tuple[Pair, ...], Field(strict=False, min_length=3)]


class Area(Table):
    """A polygon or a circle, of any height."""

    corners: Corners | None = None  # [m] world x, y of a polygon, or tables: latitude_deg, longitude_deg
    position: Pair | None = None  # [m] centre of a circle, as a corner, with radius, instead of corners
    radius: Length | None = None  # [m] of the circle

    def items(self, polygon: str, circle: str) -> list[Any]:
        """Return the items of an upload, with these actions. Raise ConfigError for neither or both shapes."""
        if self.corners is not None and self.position is None and self.radius is None:
            return [new_item(polygon, Vector3(x, y, 0.0), values=(float(len(self.corners)),)) for x, y in self.corners]
        if self.corners is None and self.position is not None and self.radius is not None:
            return [new_item(circle, Vector3(*self.position, 0.0), radius=self.radius)]
        given = ", ".join(sorted(self.model_fields_set)) or "nothing"
        raise ConfigError("", f"got {given}", "corners, or position and radius")


class FenceTable(SceneTable):
    """The geofence of all vehicles."""

    TABLE: ClassVar[str] = "fence"
    OPTIONAL: ClassVar[bool] = True
    SHARED: ClassVar[bool] = True
    keep_in: tuple[Area, ...] = Field(default=(), strict=False)  # areas that a vehicle must stay in, all at once
    keep_out: tuple[Area, ...] = Field(default=(), strict=False)  # areas that a vehicle must keep out of

    @classmethod
    def embed(cls, tree: dict[str, Any], files: Files) -> None:
        """Convert latitudes and longitudes to metres."""
        for kind in ("keep_in", "keep_out"):
            areas = unvalidated_value(tree, cls.TABLE, kind)
            for i, area in enumerate(areas if isinstance(areas, list) else ()):
                key = f"{cls.TABLE}.{kind}.{i}"
                if isinstance(area, dict) and "position" in area:
                    area["position"] = world_place(tree, f"{key}.position", area["position"])
                if isinstance(area, dict) and isinstance(corners := area.get("corners"), list):
                    area["corners"] = [world_place(tree, f"{key}.corners.{k}", at) for k, at in enumerate(corners)]

    def items(self) -> tuple[Any, ...]:
        """Return the items of an upload. Raise ConfigError for an area with neither or both shapes."""
        result = []
        for kind, areas, actions in (
            ("keep_in", self.keep_in, ("fence_inclusion", "fence_circle_in")),
            ("keep_out", self.keep_out, ("fence_exclusion", "fence_circle_out")),
        ):
            for i, area in enumerate(areas):
                try:
                    result += area.items(*actions)
                except ConfigError as error:
                    raise error.with_prefix(f"{self.TABLE}.{kind}.{i}") from None
        return tuple(result)

    def check(self, scene: Scene) -> None:
        """Raise ConfigError if an area has no shape, a vehicle starts outside, or it flies without a fence."""
        x, y, _ = start_place(scene)
        if breach := Fence(self.items()).breach(x, y):
            raise ConfigError(
                self.TABLE, f"the start at x = {x:g} m, y = {y:g} m is {breach}", "another fence or start"
            )
        if flown_by_firmware(scene):
            expected = f'autopilot.firmware = "{OWN}", or a plan with a geofence'
            raise ConfigError(self.TABLE, f"is not uploaded to {firmware_of(scene)}", expected)
        if not scene.has("autopilot"):
            raise ConfigError(self.TABLE, "has no autopilot to keep it", "[autopilot] too")


def with_fence(scene: Scene, autopilot: Any, plan: tuple[Any, ...]) -> Any:
    """Return the autopilot's configuration with the commands of a plan, after those that upload the scene's fence.

    A plan with a fence of its own replaces the scene's. An autopilot that takes no commands takes these alone, and
    ends the run after the landing as without them.
    """
    if not scene.has(FenceTable):
        return autopilot._replace(plan=plan) if plan else autopilot
    own = [OperatorCommand("fence_upload", SOURCE, 1, (), "", scene[FenceTable].items())]
    if not autopilot.operator:
        own.append(OperatorCommand("finish", SOURCE, 2, (), "", ()))
    others = [command for command in plan if command.kind != "fence_upload" or command.items]
    return autopilot._replace(operator=True, plan=(*own, *others))
