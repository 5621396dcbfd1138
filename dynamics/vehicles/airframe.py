"""An airframe as its TOML file describes it: the numbers that belong to the vehicle whatever the scene."""

import math
import tomllib
from collections.abc import Iterable
from pathlib import Path
from typing import Annotated

from annotated_types import Ge, Gt, Le, Len
from pydantic import BaseModel, ConfigDict, ValidationError, model_validator

Positive = Annotated[float, Gt(0)]
NotNegative = Annotated[float, Ge(0)]
Triple = tuple[float, float, float]
PositiveTriple = tuple[Positive, Positive, Positive]


class Section(BaseModel):
    """A table of the file: no unknown keys, numbers finite."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class Mass(Section):
    """Mass properties with payload, about the centre of mass and along the body axes."""

    total: Positive  # [kg]
    payload: NotNegative  # [kg] part of the total
    inertia: PositiveTriple  # [kg m^2]

    @model_validator(mode="after")
    def _physical(self):
        a, b, c = sorted(self.inertia)
        if a + b < c:
            raise ValueError(
                f"inertia {self.inertia} breaks the triangle inequality: the largest exceeds the others' sum"
            )
        if self.payload >= self.total:
            raise ValueError("payload must be below total")
        return self


class RotorPlacement(Section):
    """Where the rotors are and which way they turn."""

    position: Annotated[tuple[Triple, ...], Len(3)]  # [m] body
    yaw_sign: tuple[float, ...]  # +1 or -1: sign of the torque on the body about z
    inertia: Positive  # [kg m^2] of one rotor about its axis
    mass: Positive | None = None  # [kg] of one rotor, part of the total; for models that give it a body of its own
    blade_inertia: tuple[Positive, Positive] | None = None  # [kg m^2] along its blade and across, for the same

    @model_validator(mode="after")
    def _one_sign_each(self):
        if len(self.yaw_sign) != len(self.position) or any(abs(s) != 1 for s in self.yaw_sign):
            raise ValueError(f"yaw_sign must hold +1 or -1 for each of the {len(self.position)} rotors")
        return self


class Propeller(Section):
    """Geometry and blade-element constants of theory.md, eq. (1.9) to (1.11)."""

    diameter: Positive  # [m]
    pitch: Positive  # [m]
    blades: Annotated[int, Gt(0)]
    aspect_ratio: Positive
    downwash_factor: Annotated[float, Gt(0), Le(1)]
    lift_correction: Annotated[float, Gt(0), Le(1)]
    radius_weight: Annotated[float, Gt(0), Le(1)]
    oswald_factor: Annotated[float, Gt(0), Le(1)]
    zero_lift_drag: NotNegative
    zero_lift_angle: float  # [rad]
    lift_slope: Positive  # [1/rad]


class Motor(Section):
    """Brushless motor, belt and speed controller."""

    speed_constant: Positive  # [rpm/V] of the motor shaft (deliberately not SI: how motors are sold)
    belt_ratio: Positive  # propeller speed over motor speed
    idle_current: NotNegative  # [A]
    resistance: Positive  # [ohm]
    time_constant: Positive  # [s]
    max_voltage: Positive  # [V]
    esc_current: Positive  # [A]

    @property
    def rotor_constant(self) -> float:
        """[N m/A] = [V s/rad] of motor and belt, at the rotor (theory.md, eq. (1.12))."""
        return 30.0 / (math.pi * self.speed_constant * self.belt_ratio)


class Battery(Section):
    """Lithium-polymer battery."""

    cells: Annotated[int, Gt(0)]
    capacity: Positive  # [A s]
    discharge_rate: Positive  # [1/h] highest current over capacity in A h
    cell_resistance: NotNegative  # [ohm] of one cell


class Contact(Section):
    """Points that may touch the ground."""

    feet: Annotated[tuple[Triple, ...], Len(1)]  # [m] body
    hull: tuple[Triple, ...] = ()  # [m] body: what touches if the vehicle falls over


class Drag(Section):
    """Drag area of the fuselage."""

    area: PositiveTriple  # [m^2] drag coefficient times area, along body x, y, z


class PublishedFigure(Section):
    """A figure from the literature, and why the one computed here may differ."""

    value: Positive  # in SI units
    reason: str = ""


class Published(Section):
    """What others state of this vehicle; nothing computes with it."""

    source: str
    hover_time: PublishedFigure | None = None  # [s]
    highest_payload: PublishedFigure | None = None  # [kg]
    longest_range: PublishedFigure | None = None  # [m]
    ceiling: PublishedFigure | None = None  # [m]
    highest_tilt: PublishedFigure | None = None  # [rad]
    highest_speed: PublishedFigure | None = None  # [m/s]


class Airframe(Section):
    """A multirotor; the parts that it does not have are None, and so are closed to the effects that need them."""

    mass: Mass
    rotors: RotorPlacement
    motor: Motor
    propeller: Propeller | None = None
    battery: Battery | None = None
    contact: Contact | None = None
    drag: Drag | None = None
    published: Published | None = None


def one_line(error: ValidationError, where: str, choices: Iterable[str] = ()) -> str:
    """The first fault that pydantic found, as one line: where, the key, what is wrong, and what stood there.

    `choices` are the keys that there are, for the message about an unknown one.
    """
    fault = error.errors()[0]
    key = ".".join([where, *map(str, fault["loc"])]) if fault["loc"] else where
    if fault["type"] in ("extra_forbidden", "unexpected_keyword_argument"):
        return f"{key}: unknown key" + (f"; expected one of {', '.join(choices)}" if choices else "")
    message = fault["msg"].removeprefix("Value error, ").replace("Input should be", "expected")
    more = f" (and {error.error_count() - 1} more)" if error.error_count() > 1 else ""
    given = "" if fault["type"] in ("missing", "value_error") else f", got {fault['input']!r}"
    return f"{key}: {message[0].lower()}{message[1:]}{given}{more}"


def load_airframe(path: str | Path) -> Airframe:
    """Read an airframe from a TOML file.

    Raises:
        ValueError: one line that names the file, the key and what was expected.
    """
    path = Path(path)
    try:
        table = tomllib.loads(path.read_text())
    except OSError as error:
        raise ValueError(f"{path}: cannot be read: {error.strerror}") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ValueError(f"{path}: not valid TOML: {error}") from None
    return airframe_from_table(table, str(path))


def airframe_from_table(table: dict, where: str = "airframe") -> Airframe:
    """The airframe of a parsed TOML table; `where` opens the message of a ValueError."""
    try:
        return Airframe.model_validate(table)
    except ValidationError as error:
        raise ValueError(one_line(error, where)) from None
