"""Measured thrust and torque of the rotors: coefficients over advance ratio and inflow angle."""

import itertools
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np
from annotated_types import Ge, Gt, Le

from lapwing.dynamics.config_error import ConfigError
from lapwing.dynamics.effects._axes import hub_speeds
from lapwing.dynamics.effects._from_scene import Airframe, reject, validate_table
from lapwing.dynamics.effects._hooks import loads
from lapwing.dynamics.effects._propeller_data import parse_table
from lapwing.dynamics.effects._types import Loads
from lapwing.dynamics.input_file import read_text
from lapwing.dynamics.vector import pair
from lapwing.kernels import always_inline, kernel, math
from lapwing.kernels.codegen import map_tuple

INSTEAD_OF = ("rotor_thrust", "rotor_quadratic", "axial_inflow", "dynamic_inflow")
WIDEST = 0.25  # of J between two rows
LEAST_TURNS = 1e-6  # [1/s] lower limit of the speed in the advance ratio

Ratio = Annotated[float, Ge(-5), Le(5)]
Coefficient = Annotated[float, Ge(-1), Le(1)]
Curve = tuple[Coefficient, ...]


class Settings(NamedTuple):
    """Scene table: a file, or its contents."""

    file: str | None = None  # path of a table with the columns J, CT, CP relative to the scene; or these:
    advance: tuple[Ratio, ...] = ()  # J = V / (n D), growing, 0 among them
    angle_deg: tuple[Annotated[float, Ge(0), Le(180)], ...] = (0.0,)  # [deg] of the air, 0 against the rotor's flow
    thrust: tuple[Curve, ...] = ()  # C_T of each angle at each J
    power: tuple[Curve, ...] = ()  # C_P of each angle at each J
    diameter: Annotated[float, Gt(0), Le(10)] | None = None  # [m]; the airframe's propeller's if left out


class RotorTable(NamedTuple):
    """T = C_T rho n^2 D^4, Q = C_P rho n^2 D^5 / (2 pi) with coefficients from a table (theory, eq. (2.37)).

    Linear interpolation, constant beyond the first and last row. A table with one angle uses the axial air speed for
    the advance ratio; a table with several angles uses the total air speed and its angle. Source: the measurements.
    Valid within the table.
    """

    advance: np.ndarray  # (n,)
    angle: np.ndarray  # (m,) [rad]
    thrust: np.ndarray  # (m, n) of C_T D^4
    torque: np.ndarray  # (m, n) of C_P D^5 / 2 pi
    diameter: float  # [m]
    thrust_constant: float  # [m^4/rad^2] at rest in the air
    torque_constant: float  # [m^5/rad^2] at rest in the air

    @classmethod
    def from_scene(cls, table: dict, airframe: Airframe) -> "RotorTable":
        """Return the parameters of the table, with the airframe's diameter."""
        settings = validate_table(Settings, table)
        diameter = settings.diameter
        if diameter is None:
            propeller = airframe.propeller or reject("needs the key diameter: the vehicle has no [propeller]")
            diameter = propeller.diameter
        _check(settings)
        thrust = np.array(settings.thrust) * math.pow(diameter, 4)
        torque = np.array(settings.power) * math.pow(diameter, 5) / (2.0 * math.pi)
        at_rest, square = settings.advance.index(0.0), math.square(2.0 * math.pi)
        return cls(
            np.array(settings.advance), np.radians(settings.angle_deg), thrust, torque, diameter,
            float(thrust[0, at_rest]) / square, float(torque[0, at_rest]) / square,
        )  # fmt: skip


def check(table: Mapping[str, Any], tables: Mapping[str, Any]) -> None:
    """Check that no other effect defines the rotors' thrust and torque."""
    for name in INSTEAD_OF:
        if name in tables:
            reject(f"replaces effects.{name}; keep one of them")


def embed(table: dict[str, Any], path_of: Callable[[str], Path]) -> None:
    """Read the file of a scene's table, at the path of its name, into the table. Raise ConfigError if it is invalid."""
    if not isinstance(file := table.get("file"), str):
        return
    if settings := {"advance", "angle_deg", "thrust", "power"} & set(table):
        raise ConfigError(min(settings), "set together with file", "one of them")
    path = path_of(file)
    try:
        table.update(parse_table("file", read_text(path)))
    except OSError as error:
        raise ConfigError("file", f"{path}: {(error.strerror or 'cannot be read').lower()}") from None
    except UnicodeDecodeError:
        raise ConfigError("file", f"{path}: not a UTF-8 text file") from None


def _check(settings: Settings) -> None:
    """Raise ConfigError if the table cannot be interpolated."""
    j, angles = settings.advance, settings.angle_deg
    if not j:
        raise ConfigError("advance", "missing", "the advance ratios, or file = the path of a table of test data")
    for name, values in (("advance", j), ("angle_deg", angles)):
        for before, after in itertools.pairwise(values):
            if after <= before:
                raise ConfigError(name, f"got {after:g} after {before:g}", "increasing numbers")
    for before, after in itertools.pairwise(j):
        if after - before > WIDEST:
            raise ConfigError("advance", f"no row between J = {before:g} and {after:g}", f"gaps up to {WIDEST:g}")
    if 0.0 not in j or len(j) < 2:
        raise ConfigError(
            "advance", f"got J from {j[0]:g} to {j[-1]:g}", "at least two rows, including J = 0 (at rest)"
        )
    for name, curves in (("thrust", settings.thrust), ("power", settings.power)):
        if [len(curve) for curve in curves] != [len(j)] * len(angles):
            raise ConfigError(name, f"got rows of {[len(c) for c in curves]}", f"{len(angles)} of {len(j)} numbers")
        at_rest = curves[0][j.index(0.0)]
        if at_rest <= 0.0:
            raise ConfigError(name, f"got {at_rest:g} at J = 0", "a number above 0 there")


@always_inline
def _place(points, x):
    """Return (index, weight of the next point) of a value in an ascending array, clamped to it."""
    i = 0
    while i < points.shape[0] - 2 and x > points[i + 1]:
        i += 1
    return i, min(max((x - points[i]) / (points[i + 1] - points[i]), 0.0), 1.0)


@always_inline
def _along(curves, k, i, a):
    return curves[k, i] + a * (curves[k, i + 1] - curves[k, i])


@always_inline
def _between(curves, k, i, b, a):
    low = _along(curves, k, i, a)
    return low + b * (_along(curves, k + 1, i, a) - low)


@kernel
def coefficients(e, axial, across, turns):
    """Return (C_T D^4, C_Q D^5) of a rotor.

    Args:
        e: `RotorTable`.
        axial: air speed against its flow [m/s].
        across: air speed across its axis [m/s].
        turns: rotor speed in revolutions per second [1/s].
    """
    way = max(turns, LEAST_TURNS) * e.diameter
    if e.angle.shape[0] == 1:
        i, a = _place(e.advance, axial / way)
        return _along(e.thrust, 0, i, a), _along(e.torque, 0, i, a)
    i, a = _place(e.advance, math.sqrt(axial * axial + across * across) / way)
    k, b = _place(e.angle, math.atan2(across, axial))
    return _between(e.thrust, k, i, b, a), _between(e.torque, k, i, b, a)


@always_inline
def _loads(c, speed, hub):
    e, density = c
    turns = speed / (2.0 * math.pi)
    thrust, torque = coefficients(e, hub[0], hub[1], turns)
    return density * thrust * turns * turns, density * torque * turns * turns


@always_inline
def _thrust(_, before, both):
    factor, values = both
    return before + factor * values[0]


@always_inline
def _torque(_, before, both):
    factor, values = both
    return before + factor * values[1]


@loads(RotorTable)
def rotor_table(e, memory, s, factors, before):
    """Add the loads of each rotor to `before`."""
    values = map_tuple(_loads, (e, s.air.density), s.motion.rotor_speed, hub_speeds(s))
    return Loads(
        map_tuple(_thrust, 0.0, before.thrust, map_tuple(pair, 0.0, factors.thrust, values)),
        map_tuple(_torque, 0.0, before.torque, map_tuple(pair, 0.0, factors.torque, values)),
    )
