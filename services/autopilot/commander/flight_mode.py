"""What all modes have in common."""

import math

from lapwing.dynamics.vector import Vec3
from lapwing.services.autopilot.commander.commander_input import CommanderInput, Constants
from lapwing.services.autopilot.commander.guidance import Guidance
from lapwing.services.autopilot.interface import Setpoint


class FlightMode:
    """One way to move the setpoint; what it remembers is plain data."""

    needs_flight = False  # whether it can only be entered in the air
    needs_position = True  # whether it can only be entered while the vehicle knows where it is
    next_mode: str | None = None  # to go on with, once this one has done its work
    motor_voltage: tuple[float, ...] | None = None  # [V] for each motor, past the controller; None: the controller's

    def __init__(self, constants: Constants, guidance: Guidance, *values: float):
        """Entered with the values of the operator's command of its name; ValueError says why it cannot be."""

    @property
    def phase(self) -> str:
        """What it does now, for people."""
        return ""

    def step(self, constants: Constants, view: CommanderInput, guidance: Guidance) -> Setpoint | None:
        """Move the smoothed setpoint for one tick; or return another one, made from the estimate of this tick."""
        return None


def fill_in(position: Vec3, asked: Vec3) -> Vec3:
    """The position asked for; a coordinate that was not given (NaN) is that of `position`."""
    x, y, z = (p if math.isnan(a) else a for p, a in zip(position, asked, strict=True))
    return x, y, z


def value(values: tuple[float, ...], index: int) -> float:
    """A value of a command, NaN where it was not given."""
    return values[index] if index < len(values) else math.nan


def vector(values: tuple[float, ...], index: int) -> Vec3:
    """Three values of a command from `index` on, NaN where they were not given."""
    return value(values, index), value(values, index + 1), value(values, index + 2)
