"""The `[mavlink]` of a scene: who the vehicle says it is on a MAVLink link."""

from typing import Any, ClassVar, Literal

from pydantic import Field

from lapwing.cosim.scene import SceneTable


class Mavlink(SceneTable):
    """How the vehicle presents itself to ground stations."""

    TABLE: ClassVar[str] = "mavlink"
    DISTINCT: ClassVar[str] = "system"
    system: int = Field(default=1, ge=1, le=250)  # system id; each vehicle of a network needs its own
    flavour: Literal["px4", "ardupilot"] = "px4"  # whose modes, parameters and mission habits

    @classmethod
    def numbered(cls, i: int) -> dict[str, Any]:
        """1, 2, 3, ..."""
        return {"system": i + 1}
