"""Base class of trajectory segments."""

from typing import Annotated

from annotated_types import Gt
from pydantic import ConfigDict, Field

from lapwing.dynamics.validation import Table
from lapwing.services.trajectory.polynomial_piece import Piece

Finite = Annotated[float, Field(allow_inf_nan=False)]
Positive = Annotated[Finite, Gt(0.0)]


class Segment(Table):
    """A part of one channel; values are displacements from the origin in u = m (x, y, z) or rad (yaw)."""

    model_config = ConfigDict(strict=False)

    @classmethod
    def kind_name(cls) -> str:
        """Return the name that scenes use, the default of the field `kind`."""
        return cls.model_fields["kind"].default

    def pieces(self, start: float) -> list[Piece]:
        """Return the pieces from value `start` [u]. Raise ConfigError if they do not join it."""
        raise NotImplementedError

    def end(self, start: float) -> float:
        """Return the start value [u] of the next segment: `to` if the kind has this key, otherwise the present one."""
        return getattr(self, "to", start)
