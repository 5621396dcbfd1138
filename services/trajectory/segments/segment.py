"""What every kind of segment gives."""

from typing import Annotated

from annotated_types import Gt
from pydantic import BaseModel, ConfigDict, Field

from lapwing.services.trajectory.polynomial_piece import Piece

Finite = Annotated[float, Field(allow_inf_nan=False)]
Positive = Annotated[Finite, Gt(0.0)]


class Segment(BaseModel):
    """A stretch of one channel; values are displacements from the origin, u stands for m (x, y, z) or rad (yaw)."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    @classmethod
    def kind_name(cls) -> str:
        """The name that scenes use: the default of the field `kind`."""
        return cls.model_fields["kind"].default

    def pieces(self, start: float) -> list[Piece]:
        """The pieces from value `start` [u]. Raises KeyedError where they do not join it."""
        raise NotImplementedError

    def end(self, start: float) -> float:
        """The value [u] where the next segment starts: by itself, where this one started."""
        return start
