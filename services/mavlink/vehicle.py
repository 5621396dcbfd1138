"""All that the MAVLink link knows of a vehicle before it flies: one frozen value, made from a scene or from a log."""

from typing import NamedTuple

from dynamics.geodesy import Home
from services.common.parameters import Parameter


class Battery(NamedTuple):
    """A battery that is modelled."""

    cells: int  # in series
    capacity: float  # [A s]
    resistance: float  # [ohm] of all cells
    charged_voltage: float  # [V] of one full cell without load
    empty_voltage: float  # [V] of one cell, below which the motors stop


class VehicleDescription(NamedTuple):
    """A vehicle as its ground stations are told of it."""

    name: str = "drone1"  # first part of its topics' names
    system: int = 1  # MAVLink system id
    flavour: str = "px4"  # the autopilot that it emulates: a module of services/mavlink/flavours
    home: Home = Home()  # origin of the world frame on the Earth
    standing_height: float = 0.0  # [m] of the body frame's origin above the ground when it stands
    rotors: int = 4
    max_voltage: float | None = None  # [V] of its motors, None where they are not modelled
    battery: Battery | None = None  # None where none is modelled: the motors get what they ask for
    sensors: tuple[str, ...] = ()  # fitted; none: the vehicle flies on its true state
    parameters: tuple[Parameter, ...] = ()  # the autopilot's, with the values that it starts with
    gripper: bool = False  # a payload that can be let go
    accepts_commands: bool = False  # an operator is listened to
    tick_ns: int = 4_000_000  # length of a tick of the lock step [ns]
