"""Whose autopilot the vehicle emulates: a file each, found by its name."""

from collections.abc import Mapping, Sequence
from typing import Protocol, cast

from lapwing.dynamics import discovery
from lapwing.services.mavlink.mode_entry import FlightMode
from lapwing.services.mavlink.px4_facts import Fact
from lapwing.services.mavlink.vehicle_description import VehicleDescription


class Flavour(Protocol):
    """What a module of this folder has."""

    AUTOPILOT: int  # MAV_AUTOPILOT
    HOME_FIRST: bool  # whether item 0 of a mission is home
    GUIDED: bool  # whether setpoints are followed without a mode of their own
    EVENTS: bool  # whether its ground stations read events; texts alone tell them what happens where not
    TAKEOFF_ABOVE_SEA: bool  # whether a take-off's altitude counts from the sea level; else from home
    PARAMETER_ENCODING: int  # MAV_PROTOCOL_CAPABILITY that says how whole parameters travel
    MODES: Sequence[FlightMode]  # that an operator may choose
    RATES: Mapping[str, float]  # rates of messages [Hz] that differ from the telemetry's table

    def facts(self, description: VehicleDescription) -> Sequence[Fact]:
        """Parameters that its ground stations ask for and that cannot be changed."""

    def mode_number(self, mode: str) -> int:
        """The custom mode that shows a flight mode of the autopilot."""

    def mode_kind(self, number: int) -> str | None:
        """The kind of command that enters a custom mode, None where there is none."""

    def custom_mode(self, main: float, sub: float) -> int:
        """The number that DO_SET_MODE spells in two parameters."""

    def param_float(self, value: float, integer: bool) -> float:
        """A parameter's value as the float field of a message carries it."""

    def param_value(self, value: float, integer: bool) -> float:
        """A parameter's value from the float field of a message."""


def get(name: str) -> Flavour:
    """The flavour of that name; ValueError lists the choices."""
    return cast(Flavour, discovery.get(__name__, name, "flavour"))
