"""Mission of a scene for a firmware: import from a file, and conversion to messages of the mission protocol."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any, ClassVar

from lapwing.cosim.config.run_config import ServiceConfig
from lapwing.cosim.scene import Files, Scene, SceneTable
from lapwing.cosim.scene.files import unvalidated_value
from lapwing.dynamics.config_error import ConfigError
from lapwing.services.common.environment_schema import environment
from lapwing.services.common.flight_plan_file import parse
from lapwing.services.common.mavlink.dialect import mavlink
from lapwing.services.common.mavlink.geo_coordinates import Datum
from lapwing.services.common.mavlink.mission_export import to_mavlink
from lapwing.services.common.vehicle_schema import start_height

UPLOAD = "mission_upload"


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
            tree[cls.TABLE]["mission_text"] = files.text(key, key, files.folder / file)


def with_mission(scene: Scene, table: type[MissionKeys], config: ServiceConfig) -> ServiceConfig:
    """Return the configuration of an adapter with the commands that fly the scene's mission, if it has one.

    Raises:
        ConfigError: the file is not a mission.
    """
    if not scene.has(table) or not scene[table].mission_text:
        return config
    keys = scene[table]
    try:
        commands = parse(Path(keys.mission or ""), keys.mission_text, start_height(scene), environment(scene).home)
    except ValueError as error:
        raise ConfigError(f"{table.TABLE}.mission", str(error)) from None
    return config._replace(parameters=config.parameters._replace(plan=tuple(commands)))


def mission_items(commands: Sequence[Any]) -> tuple[Any, ...]:
    """Return the mission items among operator commands."""
    return next((tuple(command.items) for command in commands if command.kind == UPLOAD), ())


def mission_messages(items: Sequence[Any], datum: Datum) -> list[Any]:
    """Return the MISSION_ITEM_INT messages of mission items."""
    return to_mavlink(items, mavlink.MAV_MISSION_TYPE_MISSION, datum)


def item_message(items: Sequence[Any], number: int, target: int, seq: int, open_value: float) -> Any:
    """Return the answer to the request of a mission item.

    Args:
        items: MISSION_ITEM_INT messages.
        number: index of the item; -1: the home position, which the firmware knows.
        target: system id of the firmware.
        seq: number that the firmware requests.
        open_value: replacement of NaN in the parameters.
    """
    parameters: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0)
    if number < 0:
        frame, command, place = mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT, mavlink.MAV_CMD_NAV_WAYPOINT, (0, 0, 0.0)
    else:
        item = items[number]
        frame, command, place = item.frame, item.command, (item.x, item.y, item.z)
        values = (item.param1, item.param2, item.param3, item.param4)
        parameters = tuple(open_value if math.isnan(value) else value for value in values)
    return mavlink.MAVLink_mission_item_int_message(target, 1, seq, frame, command, 0, 1, *parameters, *place)


def result_name(result: int) -> str:
    """Return the name of a MAV_MISSION_RESULT in lower case."""
    entry = mavlink.enums["MAV_MISSION_RESULT"].get(result)
    return entry.name.lower() if entry else str(result)
