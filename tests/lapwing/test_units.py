"""Values with units in scenes: converted to the unit of their key, or rejected with it."""

import copy
import math
import tomllib
from pathlib import Path

import jsonschema
import pytest

from lapwing.cosim.scene import SceneError
from lapwing.dynamics import units
from lapwing.dynamics.effects._from_scene import validate_table
from lapwing.dynamics.validation import _replaced
from lapwing.file_schemas.descriptions import effect_settings
from lapwing.file_schemas.json_schema import SCHEMAS
from lapwing.services.scene_resolver import from_resolved, load, resolve
from lapwing.services.trajectory.schema import Trajectory, compile_trajectory

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize(
    ("text", "unit", "value"),
    [
        ("30 deg", "rad", math.pi / 6.0),
        ("0.5rad", "deg", math.degrees(0.5)),
        ("36 km/h", "m/s", 10.0),
        ("7in", "m", 0.1778),
        ("250 ms", "s", 0.25),
        ("2200 mAh", "A s", 7920.0),
        ("-1.5e2 cm", "m", -1.5),
    ],
)
def test_texts_are_numbers_in_unit(text, unit, value):
    assert units.parse(text, unit) == pytest.approx(value, rel=1e-12)


@pytest.mark.parametrize(("text", "unit"), [("30", "rad"), ("30 m", "rad"), ("x deg", "rad"), ("30 deg", "dB")])
def test_other_texts_and_units_are_no_numbers(text, unit):
    assert units.parse(text, unit) is None


def test_table_of_scene_has_converted_values():
    scene = load("hover", {"run.duration": "0.5 min", "environment.home.height": "1000 ft"})
    assert scene.lookup("run.duration") == 30.0
    assert scene.resolved["environment"]["home"]["height"] == pytest.approx(304.8)


def test_segment_and_waypoints_have_converted_values(tmp_path):
    turn = {"kind": "minimum_jerk", "to": "90 deg", "duration": "3 s"}
    path = compile_trajectory(load("hover", {"trajectory.phase.1.yaw": turn})).parameters.yaw
    assert path.coefficients[-1, 0] == pytest.approx(math.pi / 2.0)
    own = tmp_path / "own.toml"
    own.write_text('[run]\nduration = 20.0\n[vehicle]\nairframe = "delivery_drone"\n[effects.gravity]\n'
                   '[effects.rotor_thrust]\n'
                   '[autopilot]\ngains = "tuned"\nestimator = "ground_truth"\n'
                   '[trajectory]\nwaypoints = [["100 ft", 0.0, 5.0]]\nspeed = "18 km/h"\n')  # fmt: skip
    route = load(own)[Trajectory]
    assert (route.waypoints[0][0], route.speed) == (pytest.approx(30.48), pytest.approx(5.0))


def test_schema_for_editors_accepts_units_of_keys():
    validator = jsonschema.Draft7Validator(SCHEMAS["scene"]()["properties"]["run"])
    for value in (30.0, "30 s", "0.5 min"):
        assert validator.is_valid({"duration": value}), value
    for value in ("30", "30 m", "s"):
        assert not validator.is_valid({"duration": value}), value


def test_effect_and_sensor_have_converted_values():
    wind = {"speed": "18 km/h", "direction_to": "90 deg", "height": 10.0, "roughness": "3 cm"}
    camera = {"pitch_deg": "0.5 rad", "range_max": "3000 ft"}
    scene = load("hover", {"effects.wind_boundary_layer": wind, "sensors.depth_camera": camera})
    assert resolve(scene)
    assert resolve(from_resolved(scene.resolved))
    settings = validate_table(effect_settings("wind_boundary_layer"), wind)
    assert (settings.speed, settings.roughness) == (pytest.approx(5.0), pytest.approx(0.03))


HOUSE = {"position": [9.0, 0.0], "size": ["40 ft", 2.0], "top": 3.0}
DEGREES = {  # table: the same in radians, with a text, and by a key with the unit
    "effects.wind_boundary_layer": ({"speed": 5.0, "height": 10.0, "roughness": 0.03}, "direction_to"),
    "environment.terrain.steps": ({"distance": [1.0], "rise": [0.5]}, "heading"),
    "environment.terrain.box": ([HOUSE], "heading"),
    "trajectory.phase.1.yaw": ({"kind": "minimum_jerk", "duration": 3.0}, "to"),
}


@pytest.mark.parametrize("table", DEGREES)
def test_angle_has_the_same_value_in_radians_in_text_and_in_degrees(table):
    keys, angle = DEGREES[table]
    forms = [{angle: math.radians(30.0)}, {angle: "30 deg"}, {f"{angle}_deg": 30}, {f"{angle}_deg": "30 deg"}]
    tables = [[keys[0] | form] if isinstance(keys, list) else keys | form for form in forms]
    scenes = [load("hover", {table: one}) for one in tables]
    configs = [resolve(scene).services for scene in scenes]
    for config in configs[1:]:
        assert repr(config) == repr(configs[0])
    validator = jsonschema.Draft7Validator(SCHEMAS["scene"]())
    tree = tomllib.loads((ROOT / "lapwing/scenes/hover.toml").read_text())
    for one in tables:
        assert [error.message for error in validator.iter_errors(_changed(tree, table, one))] == []
    assert list(validator.iter_errors(_changed(tree, table, _both(tables[0], angle))))
    with pytest.raises(SceneError, match=f"expected one of them, got {angle} and {angle}_deg"):
        load("hover", {table: _both(tables[0], angle)})


def _both(table, angle):
    one = table[0] if isinstance(table, list) else table
    one = one | {f"{angle}_deg": 30.0}
    return [one] if isinstance(table, list) else one


def _changed(tree, key, value):
    tree = copy.deepcopy(tree)
    at, (*parents, last) = tree, key.split(".")
    for parent in parents:
        at = at[int(parent)] if isinstance(at, list) else at.setdefault(parent, {})
    at[last] = value
    return tree


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("run.duration", "30 m", "above 0 and at most 1e+06 [s], or a text with one of s, ms, min, h, got '30 m'"),
        ("run.duration", "30", "above 0 and at most 1e+06 [s], or a text with one of s, ms, min, h, got '30'"),
        ("effects.wind_constant.velocity", ["3 kg", 0.0, 0.0], "effects.wind_constant.velocity.0: expected a number"),
    ],
)
def test_value_with_wrong_unit_is_rejected(key, value, message):
    with pytest.raises(SceneError) as error:
        load("hover", {key: value})
    assert message in str(error.value)


def test_change_at_missing_place_returns_same_data():
    """Locations contain names of members of unions, and validation is repeated as long as the data change."""
    data = {"a": [{"b": "3 m"}]}
    assert _replaced(data, ("a", 0, "b"), 3.0) == {"a": [{"b": 3.0}]}
    assert _replaced(data, ("a", 0, "Member", "b"), 3.0) is data
