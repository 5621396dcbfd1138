"""The `[px4]` table of a scene."""

from typing import ClassVar

from lapwing.services.common.firmware.mission import MissionKeys


class Px4(MissionKeys):
    """PX4 in the loop."""

    TABLE: ClassVar[str] = "px4"
