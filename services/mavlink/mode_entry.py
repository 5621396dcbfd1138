"""A flight mode as ground stations list it."""

from typing import NamedTuple

from lapwing.services.common.mavlink.dialect import mavlink


class FlightMode(NamedTuple):
    """A mode that an operator may choose."""

    kind: str  # of the command that enters it; also the mode's name in Status
    name: str  # displayed
    number: int  # the custom mode
    standard: int = mavlink.MAV_STANDARD_MODE_NON_STANDARD
    advanced: bool = True  # ground stations may hide it from beginners
