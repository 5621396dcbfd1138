"""The `[ardupilot]` table of a scene."""

from typing import ClassVar, Literal

from lapwing.services.common.firmware.mission import MissionKeys


class ArduPilot(MissionKeys):
    """ArduPilot in the loop."""

    TABLE: ClassVar[str] = "ardupilot"
    inertial: Literal["truth", "sensors"] = "truth"  # source of rates and specific force; ArduPilot adds its own errors
