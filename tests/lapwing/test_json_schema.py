"""Schemas for editors: they accept the shipped files and reject the same input as the loader."""

import copy
import tomllib
from pathlib import Path

import jsonschema
import pytest

from lapwing.cosim.scene import SceneError
from lapwing.file_schemas.json_schema import SCHEMAS
from lapwing.services.scene_resolver import load

ROOT = Path(__file__).parents[2]
FILES = {
    "scene": sorted((ROOT / "lapwing/scenes").glob("*.toml")),
    "airframe": sorted((ROOT / "lapwing/scenes/vehicles").glob("*.toml")),
    "gains": sorted((ROOT / "services/autopilot/gains").glob("*.toml")),
}
VALIDATORS = {kind: jsonschema.Draft7Validator(make()) for kind, make in SCHEMAS.items()}
MISSION = tomllib.loads((ROOT / "lapwing/scenes/delivery_mission.toml").read_text())


def faults(kind, tree):
    return [error.message for error in VALIDATORS[kind].iter_errors(tree)]


@pytest.mark.parametrize("kind", SCHEMAS)
def test_schema_is_valid_and_has_examples(kind):
    jsonschema.Draft7Validator.check_schema(VALIDATORS[kind].schema)
    assert FILES[kind]


@pytest.mark.parametrize(("kind", "path"), [(k, p) for k, ps in FILES.items() for p in ps], ids=lambda x: Path(x).stem)
def test_shipped_files_match_schema(kind, path):
    assert faults(kind, tomllib.loads(path.read_text())) == []


WRONG = {
    "table": ("runn", {}),
    "key": ("run.sed", 1),
    "effect": ("effects.gravty", {}),
    "effect's key": ("effects.gravity.g", 9.81),
    "effect's bound": ("effects.random_wind_force.sigma", -1.0),
    "effect's length": ("effects.random_wind_force.mean", [1.0, 2.0]),
    "sensor": ("sensors.imuu", {}),
    "preset": ("sensors.imu.preset", "mpu"),
    "sensor's key": ("sensors.imu.gyro", {"noise": 0.1}),
    "fault's kind": ("sensors.imu.faults", [{"kind": "frozen"}]),
    "fault's channel": ("sensors.gps.faults", [{"kind": "bias", "channel": "gyro"}]),
    "integrator": ("solver.integrator", "rk5"),
    "model": ("vehicle.model", "reducd"),
    "choice": ("communication.coupling", "both"),
    "type": ("communication.rate", "250"),
    "airframe's key": ("airframe.mass", {"totl": 9.0}),
    "gain": ("gains.lft", [1.0, 0.0, 0.0]),
    "parameter": ("autopilot.parameters", {"MPC_XY_CRUIS": 3.0}),
    "parameter's bound": ("autopilot.parameters", {"MPC_XY_CRUISE": 99.0}),
    "figure": ("published.rmse", {"w": 0.1}),
    "phase's key": ("trajectory.phase.0.lasts", 3.0),
    "kind of segment": ("trajectory.phase.1.z.kind", "rmp"),
    "segment's key": ("trajectory.phase.1.z.too", 3.0),
}


def changed(key, value):
    tree = copy.deepcopy(MISSION)
    at, (*parents, last) = tree, key.split(".")
    for parent in parents:
        at = at[int(parent)] if isinstance(at, list) else at.setdefault(parent, {})
    at[last] = value
    return tree


@pytest.mark.parametrize(("key", "value"), WRONG.values(), ids=WRONG)
def test_schema_rejects_same_input_as_loader(key, value):
    with pytest.raises(SceneError):
        load("delivery_mission", {key: value})
    assert faults("scene", changed(key, value))


RIGHT = {
    "part of an airframe": ("airframe", {"mass": {"total": 9.0}}),
    "part of a gain set": ("gains", {"tilt_limit": 0.5}),
    "a file of parameters": ("autopilot.parameters", "mine.params"),
    "several segments": ("trajectory.phase.0.x", [{"kind": "hold", "duration": 1.0}, {"kind": "step", "to": 0.1}]),
    "a file of points": ("trajectory.phase.0.x", {"kind": "table", "file": "points.csv"}),
    "whole numbers": ("effects.random_wind_force.mean", [3, 1, 0]),
}


@pytest.mark.parametrize(("key", "value"), RIGHT.values(), ids=RIGHT)
def test_schema_accepts_alternative_forms(key, value):
    assert faults("scene", changed(key, value)) == []


def test_trajectory_has_phases_or_waypoints():
    tree = {**MISSION, "trajectory": {"waypoints": [[0, 0, 5.0], [10.0, 0, 5.0]], "turn": "round"}}
    assert faults("scene", tree) == []
    tree["trajectory"]["waypoints"] = [{"latitude_deg": 40.0, "longitude_deg": 14.0, "z": 5.0, "yaw_deg": "90 deg"}]
    assert faults("scene", tree) == []
    tree["trajectory"]["phase"] = MISSION["trajectory"]["phase"]
    assert faults("scene", tree) != []


def test_misspelt_key_of_airframe_or_gain_set_is_invalid():
    frame = tomllib.loads(FILES["airframe"][0].read_text())
    frame["mass"]["totl"] = frame["mass"].pop("total")
    assert len(faults("airframe", frame)) == 2  # one unknown key, one missing key
    gains = tomllib.loads(FILES["gains"][0].read_text())
    assert faults("gains", {**gains, "tiltlimit": 0.5})


def test_keys_are_explained():
    keys = VALIDATORS["scene"].schema["properties"]["effects"]["properties"]["random_wind_force"]["properties"]
    assert keys["mean"]["description"] == "[m/s] world"
    assert keys["sigma"]["default"] == 1.0


@pytest.mark.parametrize("kind", ["effects", "sensors"])
def test_schema_of_user_effect_needs_module_and_allows_keys(kind):
    own = {**MISSION, kind: {**MISSION[kind], "my_own": {"module": "my_module", "strength": 2.0}}}
    assert faults("scene", own) == []
    del own[kind]["my_own"]["module"]
    assert faults("scene", own) != []
