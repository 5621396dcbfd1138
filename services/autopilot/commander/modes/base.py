"""What all modes have in common."""

import math
from typing import TYPE_CHECKING

from dynamics.vector import Vec3

if TYPE_CHECKING:
    from services.autopilot.commander.pilot import Pilot


DEAD = 0.05  # sticks nearer to the middle ask for nothing


class FlightMode:
    """One way to lead the guide."""

    needs_flight = False  # whether it can only be entered in the air
    needs_position = True  # whether it can only be entered while the vehicle knows where it is
    next: str | None = None  # the mode to go on with, once this one has done its work

    @property
    def phase(self) -> str:
        """What it does now, for people."""
        return ""

    def step(self, pilot: "Pilot", dt: float) -> None:
        """Lead the guide for one tick of dt [s]."""


def tuple_of(here: Vec3, asked: Vec3) -> Vec3:
    """The place asked for; a coordinate that was not given (NaN) is that of `here`."""
    x, y, z = (h if math.isnan(a) else a for h, a in zip(here, asked, strict=True))
    return x, y, z


def stick(pilot: "Pilot", index: int) -> float:
    """Where a stick is, -1 to 1; in the middle where it is nearly there, or nobody holds it."""
    given = value(pilot.sticks, index)
    return given if pilot.sticks_fresh and abs(given) >= DEAD else 0.0


def value(values: tuple[float, ...], index: int) -> float:
    """A value of a command, NaN where it was not given."""
    return values[index] if index < len(values) else math.nan
