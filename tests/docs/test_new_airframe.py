"""Guide to a new airframe: its example is valid and has the values that its code computes."""

import re
import tomllib
from pathlib import Path

import jsonschema
import numpy as np
import pytest

from lapwing.dynamics.constants import STANDARD_GRAVITY
from lapwing.dynamics.vehicles import performance
from lapwing.dynamics.vehicles.airframe import Airframe
from lapwing.dynamics.vehicles.airframe_tables import Propeller
from lapwing.dynamics.vehicles.propeller import thrust_coefficient, torque_coefficient
from lapwing.file_schemas.json_schema import airframe_schema
from lapwing.services.scene_resolver import load

pytestmark = pytest.mark.long

PAGE = (Path(__file__).parents[2] / "docs/guides/new_airframe.md").read_text()
EXAMPLE = tomllib.loads(re.search(r"```toml\n(.*?)```", PAGE, re.DOTALL)[1])


def test_example_airframe_is_valid_in_scene(tmp_path):
    jsonschema.Draft7Validator(airframe_schema()).validate(EXAMPLE)
    path = tmp_path / "my_quad.toml"
    path.write_text(re.search(r"```toml\n(.*?)```", PAGE, re.DOTALL)[1])
    assert load("hover", {"vehicle.airframe": str(path)}).lookup("airframe.mass.total") == 2.0


def test_thrust_stand_data_reproduce_example_propeller():
    names: dict = {}
    exec(re.search(r"```python\n(.*?)```", PAGE, re.DOTALL)[1], names)
    assert names["lift_correction"] == pytest.approx(EXAMPLE["propeller"]["lift_correction"], abs=5e-5)
    assert names["zero_lift_drag"] == pytest.approx(EXAMPLE["propeller"]["zero_lift_drag"], abs=5e-6)
    met = Propeller(**EXAMPLE["propeller"])
    n, rho, D = names["speed"] / (2.0 * np.pi), names["density"], met.diameter
    assert rho * thrust_coefficient(met) * n**2 * D**4 == pytest.approx(names["thrust"], rel=1e-3)
    assert rho * torque_coefficient(met) * n**2 * D**5 == pytest.approx(names["torque"], rel=1e-3)


def test_example_can_hover_and_fly():
    vehicle = Airframe.model_validate(EXAMPLE)
    assert 1.8 < performance.maximum_thrust(vehicle) / (vehicle.mass.total * STANDARD_GRAVITY) < 2.5
    assert performance.trim(vehicle).thrust == pytest.approx(2.0 * 9.80665 / 4.0)
    assert 10.0 < performance.hover_time(vehicle) / 60.0 < 30.0
    assert performance.maximum_speed(vehicle) > 8.0
