"""Measurements that an airframe file needs, with instructions and plausible values."""

import math
from collections.abc import Callable, Mapping
from typing import NamedTuple

from lapwing.dynamics.config_error import ConfigError
from lapwing.dynamics.constants import STANDARD_GRAVITY

Values = Mapping[str, float]
CELL_VOLTAGE = 3.7  # [V] nominal
ROTORS = (4, 6, 8)


class Figure(NamedTuple):
    """Quantity to be measured."""

    name: str
    unit: str
    guess: Callable[[Values], float]  # estimate from the previous figures
    how: str
    least: float = 0.0
    most: float = math.inf
    zero: bool = False  # True if the least value itself is valid
    far: float = 8.0  # ratio to the guess beyond which the unit may be wrong: rpm are 9.5 times rad/s

    def check(self, value: float) -> None:
        """Raise ConfigError for an impossible value."""
        if self.unit == "count" and not float(value).is_integer():
            raise ConfigError(self.name, f"got {value:g}", "a whole number")
        if self.name == "rotors" and value not in ROTORS:
            raise ConfigError(self.name, f"got {value:g}", "4, 6 or 8; edit the file for other numbers")
        if not (self.least < value or (self.zero and value == self.least)) or not value < self.most:
            low = f"{'from' if self.zero else 'above'} {self.least:g}"
            high = f" and below {self.most:g}" if self.most < math.inf else ""
            raise ConfigError(self.name, f"got {value:g}", f"a number {low}{high}, in {self.unit}")

    def plausibility_question(self, value: float, guess: float) -> str:
        """Return a question about a value that is far from its guess; "" for a plausible value."""
        if not (value > 0.0 and guess > 0.0) or 1.0 / self.far <= value / guess <= self.far:
            return ""
        return f"{self.name} = {value:g} {self.unit}, where about {guess:.2g} is usual: is that the unit?"


FIGURES = (
    Figure("mass", "kg", lambda v: 2.0, "Total mass with battery and payload, on scales.", most=1e4, far=100.0),
    Figure("payload", "kg", lambda v: 0.0, "Part of the mass that is released in flight.", zero=True),
    Figure(
        "rotors", "count", lambda v: 4.0, "Number of rotors, 4, 6 or 8, on a circle with two side by side in front."
    ),
    Figure("arm", "m", lambda v: 0.16 * v["mass"] ** 0.5, "Distance from the centre of mass to a hub.", most=1e2),
    Figure(
        "inertia_x",
        "kg m^2",
        lambda v: 0.2 * v["mass"] * v["arm"] ** 2,
        "Hang the vehicle by two parallel wires of length L, b apart, with body x (ahead) vertical; with a period T: "
        "m g b^2 T^2 / (16 pi^2 L).",
    ),
    Figure("inertia_y", "kg m^2", lambda v: 1.1 * v["inertia_x"], "As inertia_x, with body y (left) vertical."),
    Figure(
        "inertia_z",
        "kg m^2",
        lambda v: 0.9 * (v["inertia_x"] + v["inertia_y"]),
        "As inertia_x, with body z (up) vertical; for a flat frame slightly less than the sum of the other two.",
    ),
    Figure(
        "diameter",
        "m",
        lambda v: 1.12 * v["arm"] * (4.0 / v["rotors"]) ** 0.5,
        "Diameter of the propeller, printed on it: inches times 0.0254.",
        most=1e2,
    ),
    Figure(
        "pitch",
        "m",
        lambda v: 0.45 * v["diameter"],
        "Pitch of the propeller, printed next to the diameter: inches times 0.0254.",
        most=1e2,
    ),
    Figure("blades", "count", lambda v: 2.0, "Number of blades of one propeller.", most=20.0),
    Figure("stand_density", "kg/m^3", lambda v: 1.225, "Air density at the thrust stand: pressure / (287.05 T [K])."),
    Figure(
        "stand_speed",
        "rad/s",
        lambda v: 160.0 / v["diameter"],
        "Speed of one propeller on a thrust stand at about hover thrust, by tachometer: rpm times 0.10472.",
    ),
    Figure("stand_thrust", "N", lambda v: _thrust(v), "Thrust on the stand at that speed."),
    Figure(
        "stand_torque", "N m", lambda v: 0.072 * v["stand_thrust"] * v["diameter"], "Torque on the stand at that speed."
    ),
    Figure(
        "rotor_inertia",
        "kg m^2",
        lambda v: 6.0e-5 * (v["diameter"] / 0.254) ** 5,
        "Propeller and motor bell about the shaft: hung by two threads at the tips, as for inertia_x.",
    ),
    Figure(
        "cells",
        "count",
        lambda v: max(3.0, round(2.8 * v["mass"] ** 0.5)),
        "Number of battery cells in series.",
        most=1e3,
    ),
    Figure("capacity", "mAh", lambda v: 10_000.0 * v["mass"] / v["cells"], "Capacity, printed on the battery."),
    Figure("c_rating", "C", lambda v: 30.0, "C rating, printed on the battery."),
    Figure(
        "cell_resistance",
        "ohm",
        lambda v: 20.0 / v["capacity"],
        "Load step on the warm, half-charged battery: voltage drop over current and number of cells.",
        zero=True,
    ),
    Figure(
        "speed_constant",
        "rpm/V",
        lambda v: 1.75 * _hover(v) * 30.0 / math.pi / (CELL_VOLTAGE * v["cells"]),
        "KV of the motor without propeller: rpm over (V - R I).",
    ),
    Figure("gear_ratio", "-", lambda v: 1.0, "Propeller speed over motor speed; 1 for direct drive."),
    Figure(
        "no_load_current",
        "A",
        lambda v: 0.6,
        "Current of the motor without propeller, measured together with speed_constant.",
        zero=True,
    ),
    Figure(
        "resistance",
        "ohm",
        lambda v: 0.07 * (CELL_VOLTAGE * v["cells"]) ** 2 / _hover_power(v),
        "Four-wire resistance between two motor leads, including the leads of the speed controller.",
        far=50.0,  # motors of equal power differ widely; a wrong unit is a factor of 1000
    ),
    Figure(
        "esc_current",
        "A",
        lambda v: 6.0 * _hover_power(v) / (CELL_VOLTAGE * v["cells"]),
        "Current limit, printed on the speed controller.",
    ),
    Figure(
        "time_constant",
        "s",
        lambda v: 0.05 * v["diameter"] ** 0.5,
        "Throttle step of 10 % about hover with propeller: time to 63 % of the speed change.",
    ),
    Figure("foot_depth", "m", lambda v: 0.7 * v["arm"], "Height of the centre of mass above the ground."),
    Figure(
        "foot_distance",
        "m",
        lambda v: 0.75 * v["arm"],
        "Horizontal distance from the centre of mass to a foot; four feet at the corners of a square.",
    ),
    Figure(
        "drag_area",
        "m^2",
        lambda v: 0.5 * v["arm"] ** 2,
        "Level flight at a steady speed v in still air at a tilt a: 2 m g tan(a) / (1.225 v^2).",
        zero=True,
    ),
)


def _thrust(v: Values) -> float:
    """Return a guess of the thrust [N] on the stand.

    It is 5.1 N for 10 inches at 628.3 rad/s, scaled with density, speed and diameter.
    """
    return 5.1 * v["stand_density"] / 1.225 * (v["stand_speed"] / 628.3) ** 2 * (v["diameter"] / 0.254) ** 4


def _hover(v: Values) -> float:
    """Return the rotor speed [rad/s] in hover."""
    return v["stand_speed"] * math.sqrt(v["mass"] * STANDARD_GRAVITY / v["rotors"] / v["stand_thrust"])


def _hover_power(v: Values) -> float:
    """Return the shaft power of one rotor in hover [W]."""
    speed = _hover(v)
    return v["stand_torque"] * (speed / v["stand_speed"]) ** 2 * speed
