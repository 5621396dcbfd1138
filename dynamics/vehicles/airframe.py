"""An airframe as its TOML file describes it: the numbers that belong to the vehicle whatever the scene."""

import math
import tomllib
from pathlib import Path
from typing import Annotated, Literal

from annotated_types import Ge, Gt, Le, Len
from pydantic import BaseModel, ConfigDict, ValidationError, model_validator

from dynamics.errors import KeyedError
from dynamics.validation import fault

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
    def _physical(self) -> "Mass":
        a, b, c = sorted(self.inertia)
        if a + b < c:
            raise KeyedError(
                "inertia", f"got {list(self.inertia)}", "none above the sum of the others (triangle inequality)"
            )
        if self.payload >= self.total:
            raise KeyedError("payload", f"got {self.payload:g}", f"less than total = {self.total:g} kg")
        return self


class RotorPlacement(Section):
    """Where the rotors are and which way they turn."""

    position: Annotated[tuple[Triple, ...], Len(3)]  # [m] body
    spin_direction: tuple[Literal["cw", "ccw"], ...]  # of each rotor seen from above: clockwise or counter-clockwise
    inertia: Positive  # [kg m^2] of one rotor about its axis
    mass: Positive | None = None  # [kg] of one rotor, part of the total; for models that give it a body of its own
    blade_inertia: tuple[Positive, Positive] | None = None  # [kg m^2] along its blade and across, for the same

    @model_validator(mode="after")
    def _one_direction_each(self) -> "RotorPlacement":
        if len(self.spin_direction) != len(self.position):
            expected = f'"cw" or "ccw" for each of the {len(self.position)} rotors'
            raise KeyedError("spin_direction", f"got {len(self.spin_direction)} of them", expected)
        return self

    @property
    def reaction_sign(self) -> tuple[float, ...]:
        """Sign of each rotor's reaction torque on the body about z, opposite to the rotor's own turning."""
        return tuple(1.0 if spin == "cw" else -1.0 for spin in self.spin_direction)


class Propeller(Section):
    """Geometry and blade-element constants of theory.md, eq. (1.9) to (1.11)."""

    diameter: Annotated[float, Ge(1e-3), Le(100)]  # [m] D
    pitch: Annotated[float, Ge(1e-6), Le(100)]  # [m] way of a turn without slip
    blades: Annotated[int, Gt(0)]  # how many
    aspect_ratio: Annotated[float, Ge(1e-3), Le(1e3)]  # A, of the blades
    downwash_factor: Annotated[float, Gt(0), Le(1)]  # epsilon
    lift_correction: Annotated[float, Gt(0), Le(1)]  # lambda
    radius_weight: Annotated[float, Gt(0), Le(1)]  # zeta, of the section taken for the blade, over the radius
    oswald_factor: Annotated[float, Gt(0), Le(1)]  # e
    zero_lift_drag: NotNegative  # C_fD
    zero_lift_angle: float  # [rad] alpha_0
    lift_curve_slope: Annotated[float, Ge(1e-3), Le(1e3)]  # [1/rad] K_0


class Motor(Section):
    """Brushless motor, belt and speed controller."""

    speed_constant: Positive  # [rpm/V] KV of the motor shaft (deliberately not SI: how motors are sold)
    gear_ratio: Positive  # propeller speed over motor speed
    no_load_current: NotNegative  # [A] I_0, without load
    resistance: Positive  # [ohm] of the winding
    time_constant: Annotated[float, Ge(1e-6)]  # [s] of rotor speed after a step of voltage
    max_voltage: Positive  # [V] that the controller can ask for
    esc_current: Positive  # [A] limit of the speed controller

    @property
    def rotor_constant(self) -> float:
        """[N m/A] = [V s/rad] of motor and belt, at the rotor (theory.md, eq. (1.12))."""
        return 30.0 / (math.pi * self.speed_constant * self.gear_ratio)


class Battery(Section):
    """Lithium-polymer battery."""

    cells: Annotated[int, Gt(0)]  # in series
    capacity: Positive  # [A s]
    c_rating: Positive  # [1/h] maximum current over capacity in A h
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
    reason: str = ""  # why the one computed here may differ


class Published(Section):
    """What others state of this vehicle; nothing computes with it."""

    source: str  # where the figures are from
    hover_time: PublishedFigure | None = None  # [s]
    maximum_payload: PublishedFigure | None = None  # [kg]
    maximum_range: PublishedFigure | None = None  # [m]
    ceiling: PublishedFigure | None = None  # [m]
    maximum_tilt: PublishedFigure | None = None  # [rad]
    maximum_speed: PublishedFigure | None = None  # [m/s]


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


def load_airframe(path: str | Path) -> Airframe:
    """Read an airframe from a TOML file.

    Raises:
        ValueError: one line that names the file, the key and what was expected.
    """
    path = Path(path)
    try:
        return Airframe.model_validate(tomllib.loads(path.read_text(encoding="utf-8")))
    except OSError as error:
        raise ValueError(f"{path}: cannot be read: {error.strerror}") from None
    except ValidationError as error:
        raise ValueError(f"{path}: {fault(error, Airframe)}") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ValueError(f"{path}: not valid TOML: {error}") from None
