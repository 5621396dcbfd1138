"""Tables of an airframe file: mass, rotors, propeller, motor, battery, contact, drag, published figures."""

from typing import Annotated, Literal

import numpy as np
from annotated_types import Ge, Gt, Le, Len
from pydantic import ConfigDict, model_validator

from lapwing.dynamics.config_error import ConfigError
from lapwing.dynamics.effects._types import principal_moments
from lapwing.dynamics.validation import Table
from lapwing.kernels import math

Positive = Annotated[float, Gt(0)]
NotNegative = Annotated[float, Ge(0)]
Triple = tuple[float, float, float]
PositiveTriple = tuple[Positive, Positive, Positive]

SHORTEST_AXIS = 1e-6  # smallest length of a direction


class Section(Table):
    """Table of an airframe file."""

    model_config = ConfigDict(strict=False)  # tuples are lists in TOML


class Mass(Section):
    """Mass properties with payload, about the centre of mass and along the body axes (theory, eq. (1.6a)).

    With a separate payload table, these are the properties of the vehicle without payload.
    """

    total: Positive  # [kg] total
    payload: NotNegative  # [kg] part of the total
    inertia: PositiveTriple  # [kg m^2] diagonal of the inertia matrix
    products: Triple = (0.0, 0.0, 0.0)  # [kg m^2] its elements xy, xz and yz, as in URDF; minus the integrals of xy dm
    centre: Triple = (0.0, 0.0, 0.0)  # [m] centre of mass in the coordinates of the airframe's positions

    @model_validator(mode="after")
    def _physical(self) -> "Mass":
        a, b, c = principal_moments(self.inertia, self.products)
        if a <= 0.0:
            raise ConfigError(
                "products", f"got {list(self.products)}", "smaller values: a principal moment is not above 0"
            )
        if a + b < c:
            raise ConfigError(
                "inertia", f"got {list(self.inertia)}", "none above the sum of the others (triangle inequality)"
            )
        if self.payload >= self.total:
            raise ConfigError("payload", f"got {self.payload:g}", f"less than total = {self.total:g} kg")
        return self

    @property
    def matrix(self) -> np.ndarray:
        """Inertia [kg m^2] about the centre of mass, shape (3, 3)."""
        xy, xz, yz = self.products
        return np.diag(self.inertia) + np.array([[0.0, xy, xz], [xy, 0.0, yz], [xz, yz, 0.0]])


class CarriedBox(Section):
    """Payload as a uniform box, in addition to the mass properties of the vehicle without it."""

    mass: Positive  # [kg] of the box
    position: Triple  # [m] position of its centre, body
    size: PositiveTriple  # [m] size along body x, y, z

    @property
    def inertia(self) -> np.ndarray:
        """Inertia [kg m^2] about its centre, shape (3, 3)."""
        square = np.square(self.size)
        return self.mass / 12.0 * np.diag(square.sum() - square)


class RotorPlacement(Section):
    """Positions and spin directions of the rotors."""

    position: Annotated[tuple[Triple, ...], Len(3)]  # [m] body
    spin_direction: tuple[Literal["cw", "ccw"], ...]  # of each rotor seen from above: clockwise or counter-clockwise
    axis: tuple[Triple, ...] = ()  # direction of each rotor's thrust in the body, of any length; default: body z
    inertia: Positive  # [kg m^2] of one rotor about its axis
    mass: Positive | None = None  # [kg] mass of one rotor, part of the total; for models with separate rotor bodies
    blade_inertia: tuple[Positive, Positive] | None = None  # [kg m^2] along its blade and across, for the same models

    @model_validator(mode="after")
    def _one_direction_each(self) -> "RotorPlacement":
        if len(self.spin_direction) != len(self.position):
            expected = f'"cw" or "ccw" for each of the {len(self.position)} rotors'
            raise ConfigError("spin_direction", f"got {len(self.spin_direction)} of them", expected)
        return self

    @model_validator(mode="after")
    def _upward(self) -> "RotorPlacement":
        if len(self.axis) not in (0, len(self.position)):
            expected = f"a direction for each of the {len(self.position)} rotors"
            raise ConfigError("axis", f"got {len(self.axis)} of them", expected)
        for k, (x, y, z) in enumerate(self.axis):
            if math.hypot(x, y, z) < SHORTEST_AXIS or z <= 0.0:
                expected = "a direction that points up, with z above 0: rotors push upwards"
                raise ConfigError(f"axis.{k}", f"got {[x, y, z]}", expected)
        return self

    @property
    def reaction_sign(self) -> tuple[float, ...]:
        """Sign of each rotor's reaction torque on the body about its axis, opposite to the rotor's rotation."""
        return tuple(1.0 if spin == "cw" else -1.0 for spin in self.spin_direction)

    @property
    def tilted_axis(self) -> tuple[Triple, ...]:
        """Unit vector of each rotor's thrust in the body; () if it is body z for all rotors."""
        if not any(x or y for x, y, _ in self.axis):
            return ()
        lengths = (math.hypot(*axis) for axis in self.axis)
        return tuple((x / n, y / n, z / n) for (x, y, z), n in zip(self.axis, lengths, strict=True))


class Propeller(Section):
    """Geometry and blade-element constants of theory, eq. (1.9) to (1.11)."""

    diameter: Annotated[float, Ge(1e-3), Le(100)]  # [m] D
    pitch: Annotated[float, Ge(1e-6), Le(100)]  # [m] advance per turn without slip
    blades: Annotated[int, Gt(0)]  # number of blades
    aspect_ratio: Annotated[float, Ge(1e-3), Le(1e3)]  # A, of a blade
    downwash_factor: Annotated[float, Gt(0), Le(1)]  # epsilon
    lift_correction: Annotated[float, Gt(0), Le(1)]  # lambda
    radius_weight: Annotated[float, Gt(0), Le(1)]  # zeta, radius of the blade section over the rotor radius
    oswald_factor: Annotated[float, Gt(0), Le(1)]  # e
    zero_lift_drag: NotNegative  # C_fD
    zero_lift_angle: float  # [rad] alpha_0
    lift_curve_slope: Annotated[float, Ge(1e-3), Le(1e3)]  # [1/rad] K_0
    # of [effects.dynamic_inflow]; 1.15 is usual (Leishman)
    induced_power_factor: Annotated[float, Ge(1), Le(2)] = 1.0  # kappa, induced power in hover over the ideal one


class Motor(Section):
    """Brushless motor, belt and speed controller."""

    speed_constant: Positive  # [rpm/V] KV of the motor shaft (deliberately not SI: how motors are sold)
    gear_ratio: Positive  # propeller speed over motor speed
    no_load_current: NotNegative  # [A] I_0, current without load
    resistance: Positive  # [ohm] of the winding
    time_constant: Annotated[float, Ge(1e-6)]  # [s] of the rotor speed after a voltage step
    max_voltage: Positive  # [V] largest output of the speed controller
    esc_current: Positive  # [A] limit of the speed controller
    esc_resistance: NotNegative = 0.0  # [ohm] of the speed controller and its leads
    esc_efficiency: Annotated[float, Gt(0), Le(1)] = 1.0  # power of the motor and resistances over that of the battery
    peak_current: Positive | None = None  # [A] current limit of the motor, enforced by the controller; default: none
    peak_power: Positive | None = None  # [W] power limit of the motor, enforced by the controller; default: none
    belt_efficiency: Annotated[float, Gt(0), Le(1)] = 1.0  # torque at the rotor over the torque of motor and belt
    inertia: NotNegative = 0.0  # [kg m^2] of the motor's rotor about its axis

    @property
    def current_limit(self) -> float:
        """Current limit of controller and motor [A]."""
        return min(self.esc_current, self.peak_current or math.inf)

    @property
    def power_limit(self) -> float:
        """Power limit of the motor [W]."""
        return self.peak_power or math.inf

    @property
    def rotor_constant(self) -> float:
        """Motor constant [N m/A] = [V s/rad] of motor and belt, at the rotor (theory, eq. (1.12))."""
        return 30.0 / (math.pi * self.speed_constant * self.gear_ratio)


class Battery(Section):
    """Lithium-polymer battery."""

    cells: Annotated[int, Gt(0)]  # number of cells in series
    capacity: Positive  # [A s] charge of the full battery
    c_rating: Positive  # [1/h] maximum current over capacity in A h
    cell_resistance: NotNegative  # [ohm] of one cell

    @property
    def current_limit(self) -> float:
        """Current limit of the C rating [A]."""
        return self.c_rating * self.capacity / 3600.0


class Contact(Section):
    """Points of the vehicle that can touch the ground."""

    feet: Annotated[tuple[Triple, ...], Len(1)]  # [m] body
    hull: tuple[Triple, ...] = ()  # [m] body: points that touch the ground if the vehicle falls over


class Drag(Section):
    """Drag area of the fuselage."""

    area: PositiveTriple  # [m^2] drag coefficient times area, along body x, y, z


class Posterior(Section):
    """Joint distribution of estimated parameters, written by `lapwing identify`; `lapwing campaign --vary` reads it."""

    keys: tuple[str, ...]  # of the scene
    distributions: tuple[Literal["normal", "lognormal"], ...]  # of each key
    mean: tuple[float, ...]  # in the unit of the key
    covariance: tuple[tuple[float, ...], ...]  # in the units of the keys
    correlations: tuple[tuple[float, ...], ...]  # follow from the covariance

    @model_validator(mode="after")
    def _same_size(self) -> "Posterior":
        count = len(self.keys)
        rows = (self.distributions, self.mean, self.covariance, self.correlations, *self.covariance, *self.correlations)
        if not count or any(len(row) != count for row in rows):
            raise ConfigError("keys", f"got {count}", "at least one, and as many entries in all other lists")
        if any(row[k] <= 0.0 for k, row in enumerate(self.covariance)):
            raise ConfigError("covariance", "a variance is not above 0", "positive numbers on the diagonal")
        return self


class PublishedFigure(Section):
    """Published figure, and the reason why the computed one may differ."""

    value: Positive  # in SI units
    reason: str = ""  # reason why the computed one may differ


class Published(Section):
    """Published performance of this vehicle; not used in computations."""

    source: str  # source of the figures
    hover_time: PublishedFigure | None = None  # [s] flight time in hover
    maximum_payload: PublishedFigure | None = None  # [kg] mass that it lifts
    maximum_range: PublishedFigure | None = None  # [m] distance on one charge
    ceiling: PublishedFigure | None = None  # [m] largest altitude
    maximum_tilt: PublishedFigure | None = None  # [rad] largest tilt in level flight
    maximum_speed: PublishedFigure | None = None  # [m/s] largest speed in level flight
