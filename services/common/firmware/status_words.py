"""Texts of a firmware's status, by the number that the port carries."""

from typing import NamedTuple

from lapwing.services.common.firmware.link import FirmwareOutput

NO_MISSION = 1  # MISSION_STATE of MAVLink
NO_ITEM = 65535


class Words(NamedTuple):
    """Part of the status message that the port does not have as numbers."""

    mode: str = ""
    failsafe: str = ""
    arming_blockers: tuple[str, ...] = ()
    mission_current: int = 0
    mission_count: int = 0
    mission_reached: int = NO_ITEM
    mission_state: int = NO_MISSION
    offboard_available: bool = False
    home: tuple[float, float, float] = (0.0, 0.0, 0.0)


class StatusWords:
    """Growing table of texts."""

    def __init__(self) -> None:
        """Create a table with the empty texts."""
        self.table: list[Words] = [Words()]
        self._numbers = {Words(): 0}

    def number(self, output: FirmwareOutput) -> int:
        """Return the number of an output's texts; append them if they are new."""
        words = Words(output.mode, output.text, output.arming_blockers)
        if words not in self._numbers:
            self._numbers[words] = len(self.table)
            self.table.append(words)
        return self._numbers[words]
