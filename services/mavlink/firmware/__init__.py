"""Emulated autopilot firmware: a module for each, selected by name."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple, Protocol, cast

from lapwing.dynamics import discovery
from lapwing.services.common.mavlink.dialect import mavlink
from lapwing.services.mavlink.px4_facts import Fact
from lapwing.services.mavlink.vehicle_description import VehicleDescription


class FlightMode(NamedTuple):
    """A flight mode that an operator may choose."""

    kind: str  # kind of the command that enters it; also the mode's name in Status
    name: str  # displayed
    number: int  # the custom mode
    standard: int = mavlink.MAV_STANDARD_MODE_NON_STANDARD
    advanced: bool = True  # ground stations may hide it from beginners


class Firmware(Protocol):
    """Interface of a firmware module."""

    AUTOPILOT: int  # MAV_AUTOPILOT
    HOME_FIRST: bool  # True if item 0 of a mission is home
    GUIDED: bool  # True if setpoints are followed without an offboard mode
    EVENTS: bool  # True if its ground stations read events; otherwise they get texts only
    TAKEOFF_ABOVE_SEA: bool  # True if a take-off's altitude is above sea level, otherwise above home
    PARAMETER_ENCODING: int  # MAV_PROTOCOL_CAPABILITY of the encoding of integer parameters
    MODES: Sequence[FlightMode]  # modes that an operator may select
    RATES: Mapping[str, float]  # rates of messages [Hz] that differ from the telemetry's table

    def facts(self, description: VehicleDescription) -> Sequence[Fact]:
        """Return read-only parameters that its ground stations request."""

    def mode_number(self, mode: str) -> int:
        """Return the custom mode that represents a flight mode of the autopilot."""

    def mode_kind(self, number: int) -> str | None:
        """Return the kind of command that enters a custom mode. Return None if there is none."""

    def custom_mode(self, main: float, sub: float) -> int:
        """Return the custom mode encoded in two parameters of DO_SET_MODE."""

    def param_float(self, value: float, integer: bool) -> float:
        """Return a parameter's value encoded in the float field of a message."""

    def param_value(self, value: float, integer: bool) -> float:
        """Return a parameter's value decoded from the float field of a message."""


def get(name: str) -> Firmware:
    """Return the firmware of a name. Raise ValueError with the choices if it does not exist."""
    return cast(Firmware, discovery.get(__name__, name, "firmware"))
