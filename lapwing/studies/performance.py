"""Performance card of a vehicle: computed from its models, next to published values (theory, chapter 2)."""

import math
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

from lapwing.dynamics.constants import STANDARD_GRAVITY
from lapwing.dynamics.input_file import read_text
from lapwing.dynamics.vehicles import hover_loads, performance
from lapwing.dynamics.vehicles.airframe import Airframe, load_airframe
from lapwing.services.autopilot.allocation import (
    effectiveness,
    tables,
    tilted_effectiveness,
    virtual_control_effectiveness,
)
from lapwing.services.common.schemas.vehicle_schema import airframe, rotor_constants
from lapwing.services.scene_resolver import load


class Row(NamedTuple):
    """One figure of the card, in its display unit."""

    name: str
    unit: str
    computed: float | None  # None: the vehicle lacks a required parameter
    published: float | None
    source: str
    reason: str  # reason of the difference, or of the missing computed value


def thrust_over_weight_without_a_rotor(airframe: Airframe, rotor: performance.Rotor) -> float:
    """Return the performance after the worst rotor loss, by the allocation in hover (theory, eq. (4.27)).

    Raises:
        ValueError: the rotors cannot lose one.
    """
    rotors, count = airframe.about_centre.rotors, len(airframe.rotors.position)
    reaction = tuple(sign * rotor.torque / rotor.thrust for sign in rotors.reaction_sign)
    if rotors.tilted_axis:
        B = tilted_effectiveness(rotors.position, rotors.tilted_axis, reaction)
    else:
        x, y, _ = zip(*rotors.position, strict=True)
        B = effectiveness(x, y, reaction)
    _, *loss_tables = tables(B)
    if not loss_tables:
        raise ValueError(f"the {count} rotors cannot lose one")
    most = performance.maximum_thrust(airframe, rotor=rotor) / B[0].sum()  # [N] maximum thrust of a rotor
    lifts = (most / max(collective for collective, *_ in shares) for shares in loss_tables)
    return float(virtual_control_effectiveness(B)[0] * min(lifts)) / (airframe.mass.total * STANDARD_GRAVITY)


# figure, also the name of its published value: (function, display unit, display unit in SI units)
_SHOWN: dict[str, tuple[Callable[..., Any], str, float]] = {
    "thrust over weight": (performance.thrust_over_weight, "-", 1.0),
    "the same without a rotor": (thrust_over_weight_without_a_rotor, "-", 1.0),
    "hover power": (hover_loads.power, "W", 1.0),
    "hover current": (hover_loads.current, "A", 1.0),
    "hover throttle": (hover_loads.throttle, "%", 0.01),
    "motor current in hover": (hover_loads.motor_current, "A", 1.0),
    "ESC margin in hover": (hover_loads.esc_margin, "%", 0.01),
    "battery margin in hover": (hover_loads.battery_margin, "%", 0.01),
    "hover time": (performance.hover_time, "min", 60.0),
    "maximum payload": (performance.maximum_payload, "kg", 1.0),
    "maximum range": (performance.maximum_range, "km", 1000.0),
    "ceiling": (performance.ceiling, "km", 1000.0),
    "maximum tilt": (performance.maximum_tilt, "deg", math.pi / 180.0),
    "maximum speed": (performance.maximum_speed, "m/s", 1.0),
}
# figures that are wrong if the rotors draw too little power
_POWER_FIGURES = {
    "hover power",
    "hover current",
    "motor current in hover",
    "ESC margin in hover",
    "battery margin in hover",
    "hover time",
    "maximum range",
}


def card(subject: Path) -> list[Row]:
    """Return the performance of a vehicle.

    Args:
        subject: airframe file, or scene of the vehicle.

    Raises:
        ValueError: the file is neither, or the rotor thrust is undefined.
    """
    vehicle, rotor = _vehicle(subject)
    rows, fault = [], hover_loads.power_fault(vehicle, rotor)
    source = vehicle.published.source if vehicle.published else ""
    for name, (figure, unit, size) in _SHOWN.items():
        stated = getattr(vehicle.published, name.replace(" ", "_"), None)
        computed, reason = None, stated.reason if stated else ""
        try:
            if fault and name in _POWER_FIGURES:
                raise ValueError(fault)
            value = figure(vehicle, rotor=rotor)
            computed = (value[0] if isinstance(value, tuple) else value) / size
        except ValueError as error:
            reason = str(error)
        rows.append(Row(name, unit, computed, stated.value / size if stated else None, source, reason))
    return rows


def _vehicle(subject: Path) -> tuple[Airframe, performance.Rotor]:
    try:
        tables = tomllib.loads(read_text(subject))
    except (OSError, ValueError):
        tables = {}
    if "rotors" in tables:  # an airframe file: scenes have no such table
        loaded = load_airframe(subject).loaded
        try:
            return loaded, performance.rotor_of(loaded)
        except ValueError as error:
            raise ValueError(f"{subject}: {error}") from None
    if not subject.exists() and subject.suffix:
        raise ValueError(f"{subject}: no such file or directory; expected an airframe or scene file (.toml)")
    scene = load(subject)
    frame, rotor = airframe(scene), rotor_constants(scene)
    return frame, performance.rotor_of(frame) if rotor.with_density else performance.Rotor(*rotor)
