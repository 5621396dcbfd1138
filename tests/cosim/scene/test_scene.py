"""Scenes: their tables, overrides by `--set`, source files, and cached results."""

import math
import pickle
import re
import shutil
from pathlib import Path

import numpy as np
import pytest

from lapwing.cosim.config.serialise import from_json, to_json
from lapwing.cosim.scene import Scene, SceneError
from lapwing.cosim.scene.files import parse_toml
from lapwing.services.autopilot.gains import GainSet
from lapwing.services.common.autopilot_parameters import table
from lapwing.services.common.schemas.communication_schema import Communication, Rates
from lapwing.services.common.schemas.run_schema import Run
from lapwing.services.common.schemas.vehicle_schema import Vehicle, airframe, gravity, start_height
from lapwing.services.scene_resolver import from_resolved, load, vocabulary
from lapwing.services.trajectory.schema import Trajectory

HOVER, DELIVERY = Path("lapwing/scenes/hover.toml"), Path("lapwing/scenes/delivery_mission.toml")
TEXT = HOVER.read_text()
SCENES = sorted(Path("lapwing/scenes").glob("*.toml"))


@pytest.mark.parametrize("path", SCENES, ids=str)
def test_every_scene_is_valid_and_has_title(path):
    scene = load(path)
    assert isinstance(scene, Scene)
    assert scene[Run].title
    assert scene.name == path.stem


def test_settings_by_class_and_by_key():
    scene = load(DELIVERY)
    assert scene[Communication].rate == scene.lookup("communication.rate") == 250
    assert scene[Communication].interval_ns == 4_000_000
    assert scene.lookup("sensors.gps.rate") > 0
    assert scene.has("autopilot")
    assert not scene.has("formation")
    assert not scene.has("no such table")


def test_overrides_change_values_tables_and_list_items():
    overrides = [
        "run.seed=7",
        "communication.coupling=jacobi",
        "effects.gyroscopic_torque={}",
        "trajectory.phase.1.duration=2",
    ]
    scene = load(HOVER, overrides)
    assert scene[Run].seed == 7
    assert scene[Communication].loop_delay == 2
    assert "gyroscopic_torque" in scene.tables("effects")
    assert scene[Trajectory].phase[1].duration == 2.0
    assert scene.overrides == tuple(overrides)


def test_override_accepts_integer_for_float_and_spaces():
    assert load(HOVER, ["run.duration = 3"])[Run].duration == 3.0


def test_override_values_equal_override_texts():
    texts = ["effects.random_wind_force.mean=[3, 1, 0]", "vehicle.name=a", "airframe.mass.total=9.5"]
    for mean in ((3, 1, 0), [3, 1, 0], np.array([3, 1, 0])):
        values = {"effects.random_wind_force.mean": mean, "vehicle.name": "a", "airframe.mass.total": np.float64(9.5)}
        assert load(HOVER, values) == load(HOVER, texts)


def test_overrides_change_values_of_named_files(tmp_path):
    parameters = tmp_path / "mine.params"
    parameters.write_text("MPC_XY_CRUISE 3.0\nNAV_ACC_RAD 2.0\n")
    overrides = [
        f"autopilot.parameters={parameters}", "gains.altitude=[1, 2, 3]", "gains.yaw.0=5", "airframe.mass.total=9.5",
        "airframe.propeller.diameter=0.5", "airframe.rotors.position.0=[0.4, 0.4, 0.0]",
        "sensors.imu.gyro.turn_on_bias_dps=1", "autopilot.parameters.NAV_ACC_RAD=4",
    ]  # fmt: skip
    scene = load(DELIVERY, overrides)
    assert scene[GainSet].altitude == (1.0, 2.0, 3.0)
    assert scene[GainSet].yaw[0] == 5.0
    assert airframe(scene).mass.total == 9.5
    assert airframe(scene).propeller.diameter == 0.5
    assert airframe(scene).rotors.position[0] == (0.4, 0.4, 0.0)
    assert scene.lookup("sensors.imu.gyro").turn_on_bias_dps == 1.0
    assert table(scene)["MPC_XY_CRUISE"].default == 3.0
    assert table(scene)["NAV_ACC_RAD"].default == 4.0


def test_scene_may_override_values_of_file(write):
    scene = load(write(TEXT + "\n[airframe.mass]\ntotal = 9.5\n[gains]\ntilt_limit = 0.3\n"), ["gains.yaw=[1, 2, 3]"])
    assert airframe(scene).mass.total == 9.5
    assert airframe(scene).mass.payload == 2.0
    assert (scene[GainSet].tilt_limit, scene[GainSet].yaw) == (0.3, (1.0, 2.0, 3.0))


def test_scene_stores_all_its_source_files(write, tmp_path):
    (tmp_path / "climb.csv").write_text("time,value\n0,0\n2,1\n")
    path = write(
        TEXT.replace(
            'z = { kind = "minimum_jerk", to = 1.0, duration = 3.0 }', 'z = { kind = "table", file = "climb.csv" }'
        )
    )
    scene = load(path)
    assert scene.sources == {
        "scene.toml": path.read_bytes(),
        "airframe.toml": (tmp_path / "vehicles/delivery_drone.toml").read_bytes(),
        "gains.toml": Path("services/autopilot/gains/tuned.toml").read_bytes(),
        "trajectory.phase.0.z.points.csv": (tmp_path / "climb.csv").read_bytes(),
    }
    assert scene[Trajectory].phase[0].z[0].points == ((0.0, 0.0), (2.0, 1.0))


@pytest.mark.parametrize("path", SCENES, ids=str)
def test_resolved_scene_restores_scene_without_files(path):
    scene = load(path)
    tree = from_json(to_json(scene.resolved))
    again = from_resolved(tree, path.stem)
    assert again == scene
    assert again.resolved == scene.resolved
    assert list(tree) == sorted(tree)


def test_no_file_is_read_after_loading(write, tmp_path, monkeypatch):
    (tmp_path / "climb.csv").write_text("time,value\n0,0\n2,1\n")
    path = write(
        TEXT.replace(
            'z = { kind = "minimum_jerk", to = 1.0, duration = 3.0 }', 'z = { kind = "table", file = "climb.csv" }'
        )
    )
    scene = load(path, ["airframe.mass.total=9.5"])
    shutil.rmtree(tmp_path)
    assert pickle.loads(pickle.dumps(scene)).resolved == scene.resolved
    again = pickle.loads(pickle.dumps(from_resolved(scene.resolved, scene.name)))
    assert again == scene
    for one in (scene, again):
        assert airframe(one).mass.total == 9.5
        assert (gravity(one), start_height(one)) == (9.80665, 0.35)
        assert table(one)["MPC_TILTMAX_AIR"].default == math.degrees(one[GainSet].tilt_limit)


def test_open_solver_step_stays_open_after_resolution():
    scene = load(HOVER, ["solver.accuracy=1e-3"])
    again = from_resolved(scene.resolved, scene.name)
    assert scene.section("solver").undecided
    assert again == scene
    assert again.section("solver").undecided
    assert not load(HOVER, ["solver.accuracy=1e-3", "solver.step=0.001"]).section("solver").undecided


def test_shipped_scene_is_found_by_name_from_any_folder(tmp_path, monkeypatch):
    here = load("hover")
    assert here == load(HOVER)
    monkeypatch.chdir(tmp_path)
    assert load("hover") == here
    (tmp_path / "own.toml").write_text(TEXT)  # without a neighbouring folder of airframes
    assert airframe(load("own.toml")) == airframe(here)
    with pytest.raises(SceneError, match=r"^unknown scene 'hovr'; did you mean hover\? expected one of .*, hover, "):
        load("hovr")


def test_neighbouring_file_precedes_shipped_file(write, tmp_path):
    path = write(TEXT)
    vehicle = tmp_path / "vehicles" / "delivery_drone.toml"
    vehicle.write_text(vehicle.read_text().replace("total = 10.0224", "total = 9.5"))
    (tmp_path / "gains").mkdir()
    tuned = Path("services/autopilot/gains/tuned.toml").read_text()
    (tmp_path / "gains" / "tuned.toml").write_text(tuned.replace("tilt_limit = 0.6", "tilt_limit = 0.5"))
    scene = load(path)
    assert airframe(scene).mass.total == 9.5
    assert scene[GainSet].tilt_limit == 0.5


def test_airframe_may_be_file_in_scene_folder(write):
    path = write(TEXT.replace('"delivery_drone"', '"vehicles/delivery_drone.toml"'))
    assert load(path)[Vehicle].airframe == "vehicles/delivery_drone.toml"


def test_invalid_recorded_scene_is_named():
    tree = load(HOVER).resolved
    del tree["airframe"]
    with pytest.raises(SceneError, match=r"^hover: vehicle\.airframe: missing"):
        from_resolved(tree, "hover")


def test_each_table_is_declared_once():
    assert {
        "run", "communication", "vehicle", "solver", "sensors", "autopilot", "trajectory", "airframe", "gains",
    } <= set(vocabulary().sections)  # fmt: skip


def test_cached_function_is_called_once():
    scene, calls = load("hover"), []
    assert [scene.cached(calls.append), scene.cached(calls.append)] == [None, None]
    assert calls == [scene]


def test_repeated_load_returns_independent_tables(tmp_path):
    path = tmp_path / "a.toml"
    first = parse_toml("x = { y = [1] }", path)
    first["x"]["y"].append(2)
    assert parse_toml("x = { y = [1] }", path) == {"x": {"y": [1]}}


def test_replaced_table_keeps_other_cached_results():
    requested = []

    def name(scene):
        requested.append("name")
        return scene[Vehicle].name

    def title(scene):
        requested.append("title")
        return f"{scene.cached(name)} of {scene[Run].title}"

    scene = load("hover")
    assert scene.cached(title) == scene.cached(title) == f"drone1 of {scene[Run].title}"
    retitled = scene.replaced(scene[Run].model_copy(update={"title": "another"}))
    assert retitled.cached(title) == "drone1 of another"
    assert requested == ["title", "name", "title"]
    renamed = retitled.replaced(scene[Vehicle].model_copy(update={"name": "scout"}))
    assert renamed.cached(title) == "scout of another"
    assert requested[3:] == ["title", "name"]


def test_replaced_rejects_table_that_each_vehicle_has():
    fleet = load("fleet")
    with pytest.raises(SceneError, match=r"vehicle: each of the \d vehicles has its own"):
        fleet.replaced(fleet.vehicles[0][Vehicle])
    rates = fleet[Rates].model_copy(update={"estimate": 125})
    assert [scene[Rates].estimate for scene in fleet.replaced(rates).each_vehicle] == [125] * len(fleet.vehicles)


def test_files_of_overrides_are_found_in_the_working_directory_before_the_scenes_folder(tmp_path, monkeypatch):
    airframe = Path("lapwing/scenes/vehicles/delivery_drone.toml").read_text()
    gains = Path("lapwing/services/autopilot/gains/tuned.toml").read_text()
    scene, here = tmp_path / "scenes" / "own.toml", tmp_path / "here"
    text = TEXT.replace('airframe = "delivery_drone"', 'airframe = "mine.toml"')
    assert text != TEXT
    for folder, total in ((scene.parent, 11.0), (here, 12.0)):
        folder.mkdir()
        (folder / "mine.toml").write_text(re.sub(r"(?m)^total = [\d.]+", f"total = {total}", airframe, count=1))
    (here / "own_gains.toml").write_text(gains)
    (here / "law.py").write_text("class Law:\n    rate = 250.0\n")
    scene.write_text(text)
    mass = "airframe.mass.total"
    monkeypatch.chdir(here)
    assert load(scene).lookup(mass) == 11.0
    assert load(scene, ["vehicle.airframe=mine.toml"]).lookup(mass) == 12.0
    assert load("hover", ["vehicle.airframe=mine.toml", "autopilot.gains=own_gains.toml"]).lookup(mass) == 12.0
    assert load("hover", ["autopilot.controller=law:Law"]).sources["modules.law.py"]
    fleet = load("fleet", ["vehicle.1.airframe=mine.toml"])
    assert [member.lookup(mass) for member in fleet.vehicles].count(12.0) == 1
    monkeypatch.chdir(tmp_path)
    assert load(scene, ["vehicle.airframe=mine.toml"]).lookup(mass) == 11.0
    with pytest.raises(SceneError, match="relative to the scene or the working directory"):
        load(scene, ["vehicle.airframe=other.toml"])
