"""Mission of a scene for a firmware, from a file."""

from pathlib import Path
from typing import Any, ClassVar

from lapwing.cosim.config.run_config import ServiceConfig
from lapwing.cosim.scene import Files, Scene, SceneTable
from lapwing.cosim.scene.files import unvalidated_value
from lapwing.dynamics.config_error import ConfigError
from lapwing.services.common.plans.plan_file import parse, site_of


class MissionKeys(SceneTable):
    """Mission that the run uploads to the firmware."""

    OPTIONAL: ClassVar[bool] = True
    mission: str | None = None  # path of a .plan or .waypoints file; unset: an operator flies
    mission_text: str = ""  # content of that file

    @classmethod
    def embed(cls, tree: dict[str, Any], files: Files) -> None:
        """Store the content of the mission file."""
        if isinstance(file := unvalidated_value(tree, cls.TABLE, "mission"), str):
            key = f"{cls.TABLE}.mission"
            tree[cls.TABLE]["mission_text"] = files.text(key, key, files.path(key, file))


def with_mission(scene: Scene, table: type[MissionKeys], config: ServiceConfig) -> ServiceConfig:
    """Return the configuration of an adapter with the commands that fly the scene's mission, if it has one.

    Raises:
        ConfigError: the file is not a mission.
    """
    if not scene.has(table) or not scene[table].mission_text:
        return config
    keys = scene[table]
    try:
        commands = parse(Path(keys.mission or ""), keys.mission_text, site_of(scene, firmware=True)).commands
    except ValueError as error:
        raise ConfigError(f"{table.TABLE}.mission", str(error)) from None
    if any(command.items for command in commands if command.kind in ("fence_upload", "rally_upload")):
        message = f"{keys.mission}: geofence and rally points are not uploaded to a firmware"
        raise ConfigError(f"{table.TABLE}.mission", message, "a plan without them")
    return config._replace(parameters=config.parameters._replace(plan=commands))
