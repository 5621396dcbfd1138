"""Description of a vehicle for the MAVLink link, created before the flight from a scene or a log."""

from typing import NamedTuple

from lapwing.dynamics.geodesy import Home
from lapwing.dynamics.vector import Vec3
from lapwing.services.common.autopilot_parameters import Parameter


class Battery(NamedTuple):
    """Battery of the scene's battery effect."""

    cells: int  # in series
    capacity: float  # [A s]
    resistance: float  # [ohm] of all cells
    charged_voltage: float  # [V] of one full cell without load
    empty_voltage: float  # [V] of one cell, below which the motors stop


class Rotor(NamedTuple):
    """Rotor, in the order of the autopilot."""

    position_body: Vec3  # [m]
    counterclockwise: bool  # seen from above


class VehicleDescription(NamedTuple):
    """Description of a vehicle for its ground stations."""

    name: str = "drone1"  # first part of its topic names
    system_id: int = 1  # MAVLink system id
    firmware: str = "px4"  # emulated autopilot: a module of services/mavlink/firmware
    home: Home = Home()  # origin of the world frame on the Earth
    air_temperature: float = 15.0  # [deg C] at home
    standing_height: float = 0.0  # [m] of the body frame's origin above the ground at rest
    rotors: tuple[Rotor, ...] = ()
    max_voltage: float | None = None  # [V] of its motors, None if they are not modelled
    battery: Battery | None = None  # None for an ideal supply
    sensors: tuple[str, ...] = ()  # fitted sensors; without any, the vehicle flies on its true state
    ray_deg: tuple[float, float] = (0.0, -90.0)  # azimuth and elevation of the rangefinder
    flow_interval: float = 0.0  # [s] between two readings of the optical flow
    parameters: tuple[Parameter, ...] = ()  # autopilot parameters with their initial values
    gripper: bool = False  # True if it can release a payload
    accepts_commands: bool = False  # True if it accepts commands of an operator
    tick_ns: int = 4_000_000  # length of a tick of the lock step [ns]
