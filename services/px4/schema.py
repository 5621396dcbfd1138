"""The `[px4]` table of a scene."""

from itertools import pairwise
from typing import Annotated, ClassVar

from annotated_types import Ge, Le, Len
from pydantic import Field, field_validator

from lapwing.services.common.firmware.mission import MissionKeys

RC = "rc"  # in place of a port
RcRow = Annotated[list[Annotated[float, Ge(0), Le(1e5)]], Len(2, 18)]


class Px4(MissionKeys):
    """PX4 in the loop."""

    TABLE: ClassVar[str] = "px4"
    rc: list[RcRow] = Field([])  # radio: rows of time [s] and pulses [us] of channels 1 to 17, each held until the next

    @field_validator("rc")
    @classmethod
    def _check_times(cls, rows: list[RcRow]) -> list[RcRow]:
        if any(later[0] <= row[0] for row, later in pairwise(rows)):
            raise ValueError("expected rows with increasing times")
        return rows
