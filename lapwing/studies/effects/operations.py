"""Cost of an effect as a number that does not depend on the machine or its load: operations that it adds to a step.

The source of the step is executed in extended numbers (`accuracy.round_off`), whose operations are counted.
"""

import sys
from functools import cache
from pathlib import Path
from types import FrameType
from typing import Any

from lapwing import scenes
from lapwing.dynamics import effects
from lapwing.dynamics.integrators import rk4_renormalised
from lapwing.dynamics.vehicles import multirotor
from lapwing.dynamics.vehicles.airframe import load_airframe
from lapwing.studies.accuracy.round_off import extend, in_extended_precision

FLIGHT = "gravity", "rotor_thrust"  # the other effects of the step
EXAMPLES: dict[str, dict] = {  # required keys
    "ceiling_effect": {"height": 12.0},
    "rotor_quadratic": {"thrust_constant": 2.2e-4, "torque_constant": 8.6e-6},
    "rotational_drag": {"linear": [0.1, 0.1, 0.1]},
    "rotor_damage": {"rotor": 1},
    "rotor_table": {"advance": [0.0, 0.2], "thrust": [[0.1, 0.08]], "power": [[0.04, 0.038]]},
    "shared_slung_load": {"mass": 2.0, "length": 3.0},
    "wind_constant": {"velocity": [3.0, 1.0, 0.0]},
    "wind_dryden": {"wind_speed": 5.0},
    "wind_dryden_rates": {"wind_speed": 5.0},
    "wind_von_karman": {"wind_speed": 5.0},
    "wind_boundary_layer": {"speed": 5.0},
    "wind_gust": {"peak": [3.0, 0.0, 0.0], "start": 0.0, "duration": 1.0},
}
TICK, STEP = 400, 1e-3  # [s] tick of the step: 0.4 s, in the gust
FUNCTIONS = {"f", "power", "atan2", "hypot", "cos_sin"}  # names in mpmath of elementary functions: one operation each
COUNTED = {f"__{name}__" for name in ("add", "sub", "mul", "truediv", "mod")} | FUNCTIONS


def added_operations(name: str) -> int:
    """Return the operations that an effect adds to a step of RK4, or to one without the effect that it replaces.

    The delivery drone flies slowly at 10 m, alone, with the effects of `FLIGHT` and this one.

    Raises:
        ConfigError: the drone cannot have the effect.
    """
    others = tuple(other for other in FLIGHT if _kind(other) != _kind(name))
    return operations((*others, name)) - operations(others)


def _kind(name: str) -> str:
    return getattr(effects.get("rotor_thrust" if name == "rotor_table" else name), "KIND", name)


@cache
def operations(names: tuple[str, ...]) -> int:
    """Return the operations of a step of RK4 with these effects; see `added_operations`."""
    tables = {name: EXAMPLES.get(name, {}) for name in names}
    airframe = load_airframe(Path(scenes.__file__).parent / "vehicles/delivery_drone.toml")
    p = multirotor.parameters(airframe, effects.from_scene(tables, airframe))
    voltage = 0.5 * p.layout.max_voltage
    speed = 0.99 * voltage * p.layout.speed_per_volt  # so that every motor has a current
    state = multirotor.initial_state(p, (0.0, 0.0, 10.0), rotor_speed=speed, velocity_world=(1.0, 0.5, -0.2))
    numbers = [in_extended_precision(value) for value in (p, state, (voltage,) * len(p.layout.x_body), STEP)]
    step, token, count = extend(multirotor.advance), rk4_renormalised.Method(), 0

    def observe(frame: FrameType, event: str, _: Any) -> None:
        nonlocal count
        count += event == "call" and frame.f_code.co_name in COUNTED and "mpmath" in frame.f_code.co_filename

    p, state, voltages, h = numbers
    before = sys.getprofile()
    sys.setprofile(observe)
    try:
        step(token, p, (0, 0), TICK, state, voltages, h, 1)
    finally:
        sys.setprofile(before)
    return count
