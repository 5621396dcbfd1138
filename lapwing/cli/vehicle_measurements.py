"""Figures of a vehicle that an airframe file needs: instructions, bounds, units, and parts with published figures."""

import math
import re
import tomllib
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import NamedTuple

from lapwing.dynamics import units
from lapwing.dynamics.config_error import ConfigError
from lapwing.dynamics.units import INCH

Values = Mapping[str, float]
ROTORS = (4, 6, 8)
LIKELY = 4.0  # ratio to the estimate within which a value in another unit was probably meant
SIZE = re.compile(r"(\d+\.?\d*)x(\d+\.?\d*)(?:x(\d))?")  # inches, as printed on a propeller: 10x4.5, 5.1x4.3x3


class Figure(NamedTuple):
    """Quantity to be measured."""

    name: str
    unit: str
    how: str
    least: float = 0.0
    most: float = math.inf
    zero: bool = False  # True if the least value itself is valid
    far: float = 8.0  # ratio to the estimate beyond which the unit may be wrong: rpm are 9.5 times rad/s

    def parse(self, text: str) -> float:
        """Return a value in the figure's unit from a text like 0.75, "750 g" or 7in.

        Raises:
            ConfigError: not a number, an unknown unit, or an impossible value.
        """
        value = units.parse(text, self.unit, bare=True)
        if value is None:
            others = ", ".join(name for name in units.UNITS.get(self.unit, ()) if name not in (self.unit, '"'))
            expected = f"a number in {self.unit}" + (f", or with a unit of {others}" if others else "")
            raise ConfigError(self.name, f"got {text!r}", "a whole number" if self.unit == "count" else expected)
        self.check(value)
        return value

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
        """Return a question about a value that is far from its estimate; "" for a plausible value."""
        if self._likely(value, guess, self.far):
            return ""
        return (
            f"{self.name} = {self._far_from(value, guess)}: is that {'right' if self.unit == 'count' else 'the unit'}?"
        )

    def check_unit(self, value: float, guess: float) -> None:
        """Raise ConfigError for a number without a unit that is far from its estimate, but near it in another unit."""
        others = {name: size * value for name, size in units.UNITS.get(self.unit, {}).items() if name != '"'}
        near = [name for name, other in others.items() if self._likely(other, guess, LIKELY)]
        if near and not self._likely(value, guess, self.far):
            meant = min(near, key=lambda name: abs(math.log(others[name] / guess)))
            expected = f"{value:g}{meant}, or {value:g}{self.unit.replace(' ', '')} if that is right"
            raise ConfigError(f"{self.name}={value:g}", self._far_from(value, guess), expected)

    def _far_from(self, value: float, guess: float) -> str:
        unit = "" if self.unit in ("count", "-") else f" {self.unit}"
        return f"{value:g}{unit}, where about {float(f'{guess:.2g}'):g} is usual"

    @staticmethod
    def _likely(value: float, guess: float, factor: float) -> bool:
        return not (value > 0.0 and guess > 0.0) or 1.0 / factor <= value / guess <= factor


FIGURES = (
    Figure("mass", "kg", "Total mass with battery and payload, on scales.", most=1e4, far=100.0),
    Figure("payload", "kg", "Part of the mass that is released in flight.", zero=True),
    Figure("rotors", "count", "Number of rotors, 4, 6 or 8, on a circle with two side by side in front."),
    Figure("arm", "m", "Distance from the centre of mass to a hub.", most=1e2),
    Figure(
        "inertia_x",
        "kg m^2",
        "Hang the vehicle by two parallel wires of length L, b apart, with body x (ahead) vertical; with a period T: "
        "m g b^2 T^2 / (16 pi^2 L).",
    ),
    Figure("inertia_y", "kg m^2", "As inertia_x, with body y (left) vertical."),
    Figure(
        "inertia_z",
        "kg m^2",
        "As inertia_x, with body z (up) vertical; for a flat frame slightly less than the sum of the other two.",
    ),
    Figure("diameter", "m", "Diameter of the propeller, printed on it, for example 10in.", most=1e2),
    Figure("pitch", "m", "Pitch of the propeller, printed next to the diameter, for example 4.5in.", most=1e2),
    Figure("blades", "count", "Number of blades of one propeller.", most=20.0),
    Figure("stand_density", "kg/m^3", "Air density at the thrust stand: pressure / (287.05 T [K])."),
    Figure(
        "stand_speed",
        "rad/s",
        "Speed of one propeller on a thrust stand at about hover thrust, by tachometer, for example 6000rpm.",
    ),
    Figure("stand_thrust", "N", "Thrust on the stand at that speed."),
    Figure("stand_torque", "N m", "Torque on the stand at that speed."),
    Figure(
        "rotor_inertia", "kg m^2", "Propeller and motor bell about the shaft: hung by two threads, as for inertia_x."
    ),
    Figure("cells", "count", "Number of battery cells in series, for example 6S.", most=1e3),
    Figure("capacity", "mAh", "Capacity, printed on the battery."),
    Figure("c_rating", "C", "C rating, printed on the battery."),
    Figure(
        "cell_resistance",
        "ohm",
        "Load step on the warm, half-charged battery: voltage drop over current and number of cells.",
        zero=True,
    ),
    Figure("gear_ratio", "-", "Propeller speed over motor speed; 1 for direct drive."),
    Figure("speed_constant", "rpm/V", "KV of the motor without propeller: rpm over (V - R I)."),
    Figure(
        "no_load_current",
        "A",
        "Current of the motor without propeller, measured together with speed_constant.",
        zero=True,
    ),
    Figure(
        "resistance",
        "ohm",
        "Four-wire resistance between two motor leads, including the leads of the speed controller.",
        far=50.0,  # motors of equal power differ widely; a wrong unit is a factor of 1000
    ),
    Figure("esc_current", "A", "Current limit, printed on the speed controller.", far=20.0),
    Figure("peak_current", "A", "Current limit, printed on the motor.", far=20.0),
    Figure("time_constant", "s", "Throttle step of 10 % about hover with propeller: time to 63 % of the speed change."),
    Figure("foot_depth", "m", "Height of the centre of mass above the ground."),
    Figure(
        "foot_distance",
        "m",
        "Horizontal distance from the centre of mass to a foot; four feet at the corners of a square.",
    ),
    Figure(
        "drag_area",
        "m^2",
        "Level flight at a steady speed v in still air at a tilt a: 2 m g tan(a) / (1.225 v^2).",
        zero=True,
    ),
)
BY_NAME = {figure.name: figure for figure in FIGURES}


def parse_settings(settings: list[str]) -> dict[str, float]:
    """Return figures by name from texts like mass=750g, motor=kde4014xf_380 or propeller=10x4.5.

    A figure that is set itself has precedence over that of a part.

    Raises:
        ConfigError: an unknown figure or part, a wrong unit, or an impossible value.
    """
    single: dict[str, float] = {}
    of_parts: dict[str, float] = {}
    for setting in settings:
        name, _, text = (part.strip() for part in setting.partition("="))
        try:
            if name in parts():
                of_parts |= _part(name, text)
            elif name in BY_NAME:
                single[name] = BY_NAME[name].parse(text)
            else:
                raise ConfigError.unknown("", "figure", name, [*BY_NAME, *parts()])
        except ConfigError as error:
            raise ConfigError(f"--set {setting}", error.message, error.expected) from None
    return of_parts | single


def without_unit(settings: list[str]) -> set[str]:
    """Return the names of the figures whose texts are numbers alone."""
    texts = {name.strip(): text for name, _, text in (setting.partition("=") for setting in settings)}
    return {name for name, text in texts.items() if name in BY_NAME and units.parse(text, BY_NAME[name].unit) is None}


@cache
def parts() -> dict[str, dict[str, dict]]:
    """Return the parts with published figures by kind and name, each with its source."""
    text = (Path(__file__).parent / "vehicle_parts.toml").read_text(encoding="utf-8")
    return tomllib.loads(text)


def _part(kind: str, name: str) -> dict[str, float]:
    """Return the figures of a part; a propeller may also be its size in inches."""
    if kind == "propeller" and (size := SIZE.fullmatch(name)):
        diameter, pitch, blades = size.groups()
        return {"diameter": float(diameter) * INCH, "pitch": float(pitch) * INCH, "blades": float(blades or 2)}
    if name not in parts()[kind]:
        raise ConfigError.unknown("", kind, name, parts()[kind])
    return {key: float(value) for key, value in parts()[kind][name].items() if key != "source"}
