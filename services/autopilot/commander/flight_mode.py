"""Base class of flight modes."""

import math

from lapwing.dynamics.vector import Vec3
from lapwing.services.autopilot.commander.commander_input import CommanderInput, Constants
from lapwing.services.autopilot.commander.guidance import Guidance
from lapwing.services.common.ports import Setpoint


class FlightMode:
    """A flight mode, which moves the setpoint; its state is plain data."""

    needs_flight = False  # can only be entered in flight
    needs_position = True  # needs a known position
    next_mode: str | None = None  # mode to enter when this one is done
    motor_voltage: tuple[float, ...] | None = None  # direct voltages [V]; None: the controller's

    def __init__(self, constants: Constants, guidance: Guidance, *values: float):
        """Enter with the values of the operator's command. Raise ValueError if it cannot be entered."""

    @property
    def phase(self) -> str:
        """Text of the current part of the mode."""
        return ""

    def step(self, constants: Constants, view: CommanderInput, guidance: Guidance) -> Setpoint | None:
        """Move the smoothed setpoint for one tick, or return a setpoint computed from this tick's estimate."""
        return None


def fill_in(position: Vec3, requested: Vec3) -> Vec3:
    """Return `requested` with NaN coordinates replaced by those of `position`."""
    x, y, z = (p if math.isnan(a) else a for p, a in zip(position, requested, strict=True))
    return x, y, z


def value(values: tuple[float, ...], index: int) -> float:
    """Return a value of a command, NaN if it is missing."""
    return values[index] if index < len(values) else math.nan


def vector(values: tuple[float, ...], index: int) -> Vec3:
    """Return three values of a command from `index`, NaN if they are missing."""
    return value(values, index), value(values, index + 1), value(values, index + 2)
