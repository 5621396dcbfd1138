"""Airframe file from the measurements of a vehicle."""

import json
import math
import tomllib
from typing import Any

from lapwing.cli.vehicle_estimates import propeller
from lapwing.cli.vehicle_measurements import FIGURES, Values
from lapwing.dynamics.config_error import ConfigError
from lapwing.dynamics.validation import validated
from lapwing.dynamics.vehicles.airframe import Airframe
from lapwing.dynamics.vehicles.performance import CELL_VOLTAGE
from lapwing.dynamics.vehicles.propeller import from_stand

SPINS = {  # clockwise or counter-clockwise seen from above, alternating
    4: ("cw", "ccw", "cw", "ccw"),
    6: ("cw", "ccw", "cw", "ccw", "cw", "ccw"),
    8: ("cw", "ccw", "cw", "ccw", "cw", "ccw", "cw", "ccw"),
}
FIGURE_OF_KEY = {  # figures of keys with another name
    "mass.total": "mass",
    "mass.inertia": "inertia_x, inertia_y, inertia_z",
    "rotors.inertia": "rotor_inertia",
}


def airframe_of(v: Values) -> Airframe:
    """Return the airframe for the figures.

    Raises:
        ConfigError: figures that do not fit together; its key is the figure.
    """
    try:
        return validated(Airframe.model_validate, tomllib.loads(airframe_text("new", v, set(v))), Airframe)
    except ConfigError as error:
        table, _, key = error.key.partition(".")
        key = FIGURE_OF_KEY.get(error.key) or (key.partition(".")[0] if key else f"stand_{table}")
        raise ConfigError(key, error.message, error.expected) from None


def airframe_text(name: str, v: Values, measured: set[str]) -> str:
    """Return the text of the airframe file; figures that are not in `measured` are marked as guessed."""
    count = int(v["rotors"])
    shape = propeller(v)
    stand = v["stand_density"], v["stand_speed"], v["stand_thrust"], v["stand_torque"]
    fitted = dict(zip(("lift_correction", "zero_lift_drag"), from_stand(shape, *stand), strict=True))
    geometry = shape.model_dump(exclude_defaults=True) | fitted
    hubs = [_place(v["arm"], math.pi / count + 2.0 * math.pi * k / count, 0.0) for k in range(count)]
    feet = [_place(v["foot_distance"], math.pi / 4.0 + math.pi / 2.0 * k, -v["foot_depth"]) for k in range(4)]
    inertia = [v["inertia_x"], v["inertia_y"], v["inertia_z"]]
    motor = ["speed_constant", "gear_ratio", "no_load_current", "resistance", "time_constant", "esc_current"]
    motor += ["peak_current"] * ("peak_current" in measured)
    guessed = ", ".join(sorted(set(v) - measured - {"peak_current"}))  # which only a measurement brings into the file
    units = {figure.name: figure.unit for figure in FIGURES}
    lines = [
        f"# {name}, written by `lapwing new vehicle`. SI units.",
        "# docs/guides/new_airframe.md describes how each figure is measured.",
        f"# Guessed, not measured: {guessed or 'nothing'}.",
        "",
        "[mass]",
        _line("total", v["mass"], "kg"),
        _line("payload", v["payload"], "kg, part of the total"),
        _line("inertia", inertia, "kg m^2 about body x, y, z"),
        "",
        "[rotors]  # from ahead on the left, counter-clockwise seen from above",
        _line("position", hubs, "m, body"),
        _line("spin_direction", list(SPINS[count]), "seen from above: compare with yours"),
        _line("inertia", v["rotor_inertia"], "kg m^2 about the shaft"),
        "",
        "[propeller]  # lift_correction and zero_lift_drag fit the thrust stand, the others are typical values",
        *[_line(key, value) for key, value in geometry.items()],
        "",
        "[motor]",
        *[_line(key, v[key], units[key]) for key in motor],
        _line("max_voltage", CELL_VOLTAGE * v["cells"], "V, nominal"),
        "",
        "[battery]",
        _line("cells", int(v["cells"]), "in series"),
        _line("capacity", 3.6 * v["capacity"], "A s"),
        _line("c_rating", v["c_rating"], "C"),
        _line("cell_resistance", v["cell_resistance"], "ohm"),
        "",
        "[contact]",
        _line("feet", feet, "m, body"),
        _line("hull", hubs, "m, body"),
        "",
        "[drag]",
        _line("area", [v["drag_area"], v["drag_area"], 2.5 * v["drag_area"]], "m^2 along body x, y, z"),
    ]
    return "\n".join(lines) + "\n"


def _place(radius: float, angle: float, height: float) -> list[float]:
    return [round(radius * math.cos(angle), 6) + 0.0, round(radius * math.sin(angle), 6) + 0.0, height]  # no -0.0


def _line(key: str, value: Any, comment: str = "") -> str:
    return f"{key} = {_toml(value)}" + (f"  # {comment}" if comment else "")


def _toml(value: Any) -> str:
    if isinstance(value, list):
        return f"[{', '.join(map(_toml, value))}]"
    return str(float(f"{value:.6g}")) if isinstance(value, float) else json.dumps(value)
