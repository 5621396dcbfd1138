"""The `[mavlink]` table of a scene: identity of the vehicle on a MAVLink link, and messages of a user module."""

from typing import Any, ClassVar, Literal

from pydantic import Field

from lapwing.cosim.scene import Files, Scene, SceneTable
from lapwing.cosim.scene.files import unvalidated_value
from lapwing.dynamics.config_error import ConfigError
from lapwing.services.common import user_code, user_modules


class Mavlink(SceneTable):
    """Identity of the vehicle for ground stations."""

    TABLE: ClassVar[str] = "mavlink"
    DISTINCT: ClassVar[str] = "system_id"
    system_id: int = Field(default=1, ge=1, le=250)  # MAVLink system id, unique for each vehicle of a network
    firmware: Literal["px4", "ardupilot"] = "px4"  # autopilot whose modes, parameters and mission rules are emulated
    module: str | None = None  # user module that declares further messages with `lapwing.plugins.stream`

    @classmethod
    def embed(cls, tree: dict[str, Any], files: Files) -> None:
        """Store the user module."""
        if isinstance(module := unvalidated_value(tree, cls.TABLE, "module"), str):
            user_modules.embed(tree, files, "mavlink.module", module)

    @classmethod
    def defaults_of(cls, i: int) -> dict[str, Any]:
        """Return the system ids 1, 2, 3, ..."""
        return {"system_id": i + 1}

    def check(self, scene: Scene) -> None:
        """Raise ConfigError unless the user module can be imported and declares a message."""
        if self.module is None:
            return
        from lapwing.services.mavlink.telemetry.message_stream import STREAMS  # imports pymavlink

        user_code.load_module("mavlink.module", self.module, user_modules.texts(scene))
        if not any(stream.build.__module__ == self.module for stream in STREAMS.values()):
            expected = '@stream("NAME", rate) with a message of the MAVLink dialect'
            raise ConfigError("mavlink.module", f"{self.module} declares no message", expected)
