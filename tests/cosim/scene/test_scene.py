"""Scenes: what they hold, what `--set` changes, and that a fault is named with file, line, key and choices."""

import math
import pickle
import shutil
from pathlib import Path

import numpy as np
import pytest

from lapwing.cosim.config.serialise import from_json, to_json
from lapwing.cosim.scene import Scene, SceneError
from lapwing.cosim.scene.files import parse_toml
from lapwing.services.autopilot.gains import GainSet
from lapwing.services.common.autopilot_parameters import table
from lapwing.services.common.communication_schema import Communication
from lapwing.services.common.run_schema import Run
from lapwing.services.common.vehicle_schema import Vehicle, airframe, gravity, start_height
from lapwing.services.scene_resolver import from_resolved, load, vocabulary
from lapwing.services.trajectory.schema import Trajectory

HOVER, DELIVERY = Path("lapwing/scenes/hover.toml"), Path("lapwing/scenes/delivery_mission.toml")
TEXT = HOVER.read_text()
CLIMB = 'z = { kind = "minimum_jerk", to = 1.0, duration = 3.0 }'
BOUNDED = "a number above 0 and at most 1e+06"
SCENES = sorted(Path("lapwing/scenes").glob("*.toml"))


@pytest.fixture
def write(tmp_path):
    """Writes a scene file beside a copy of the airframes."""
    shutil.copytree("lapwing/scenes/vehicles", tmp_path / "vehicles")

    def write_(text):
        path = tmp_path / "scene.toml"
        path.write_text(text)
        return path

    return write_


def refused(path, *overrides):
    with pytest.raises(SceneError) as caught:
        load(path, overrides)
    assert "\n" not in str(caught.value)
    return caught.value


def said(path, *overrides):
    return str(refused(path, *overrides)).removeprefix(f"{path}:")


def line(text, part):
    """Number of the first line that starts with `part`."""
    return next(n for n, line in enumerate(text.splitlines(), 1) if line.startswith(part))


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


def test_overrides_change_values_add_tables_and_reach_into_lists():
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


def test_values_by_key_do_as_well_as_texts():
    texts = ["effects.random_wind_force.mean=[3, 1, 0]", "vehicle.name=a", "airframe.mass.total=9.5"]
    for mean in ((3, 1, 0), [3, 1, 0], np.array([3, 1, 0])):
        values = {"effects.random_wind_force.mean": mean, "vehicle.name": "a", "airframe.mass.total": np.float64(9.5)}
        assert load(HOVER, values) == load(HOVER, texts)


def test_overrides_reach_into_files_that_scene_names(tmp_path):
    parameters = tmp_path / "mine.params"
    parameters.write_text("MPC_XY_CRUISE 3.0\nNAV_ACC_RAD 2.0\n")
    overrides = [
        f"autopilot.parameters={parameters}",
        "gains.altitude=[1, 2, 3]",
        "gains.yaw.0=5",
        "airframe.mass.total=9.5",
        "airframe.propeller.diameter=0.5",
        "airframe.rotors.position.0=[0.4, 0.4, 0.0]",
        "sensors.imu.gyro.turn_on_bias_dps=1",
        "autopilot.parameters.NAV_ACC_RAD=4",
    ]
    scene = load(DELIVERY, overrides)
    assert scene[GainSet].altitude == (1.0, 2.0, 3.0)
    assert scene[GainSet].yaw[0] == 5.0
    assert airframe(scene).mass.total == 9.5
    assert airframe(scene).propeller.diameter == 0.5
    assert airframe(scene).rotors.position[0] == (0.4, 0.4, 0.0)
    assert scene.lookup("sensors.imu.gyro").turn_on_bias_dps == 1.0
    assert table(scene)["MPC_XY_CRUISE"].default == 3.0
    assert table(scene)["NAV_ACC_RAD"].default == 4.0


def test_scene_may_lay_its_own_values_over_file(write):
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
    (tmp_path / "own.toml").write_text(TEXT)  # no folder of airframes beside it
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


@pytest.mark.parametrize(
    ("old", "new", "at", "expected"),
    [
        ("seed = 1", "sed = 1", "sed", "run.sed: unknown key 'sed'; did you mean seed?"),
        ("[run]", "[rnu]", "[rnu]", "rnu: unknown table 'rnu'; did you mean run?"),
        (
            "duration = 20.0",
            'duration = "20"',
            'duration = "20"',
            "run.duration: expected a number above 0 and ",
        ),
        ("duration = 20.0", "duration = true", "duration = true", ", got True"),
        ("duration = 20.0", "", "[run]", "run.duration: missing; expected a number"),
        ("duration = 20.0", "duration = -1", "duration = -1", "above 0 and at most 1e+06 [s], got -1"),
        ("[effects.gravity]", "[effects.gravy]", "[effects.gravy]", "unknown effect 'gravy'; did you mean gravity?"),
        ('gains = "tuned"', 'gains = "tune"', "gains", "autopilot.gains: unknown gain set 'tune'; did you mean tuned?"),
        (
            '"delivery_drone"',
            '"delivery"',
            "airframe",
            "unknown airframe 'delivery'; did you mean delivery_d",
        ),
        ('"delivery_drone"', '"a/b.toml"', "airframe", "vehicle.airframe: no file"),
        ('airframe = "delivery_drone"', "", "[vehicle]", "vehicle.airframe: missing; expected the name of an airframe"),
        ("duration = 2.0", "length = 2.0", "length", "trajectory.phase.3.length: unknown key"),
        ('z = { kind = "minimum_jerk", to = 0.0', 'z = { kind = "jerk", to = 0.0', 'z = { kind = "jerk"', "phase.2.z"),
        (
            "[run]",
            "[airframe.mass]\ntotal = -1\n[run]",
            "total",
            "airframe.mass.total: expected a number above 0 [kg], got -1",
        ),
    ],
)
def test_fault_is_named_with_its_line_and_key(write, old, new, at, expected):
    assert old in TEXT
    text = TEXT.replace(old, new, 1)
    fault = said(write(text))
    assert fault.startswith(f"{line(text, at)}: ")
    assert expected in fault


def test_fault_is_value(write):
    text = TEXT.replace("duration = 20.0", "duration = -1")
    path = write(text)
    fault = refused(path)
    assert (fault.key, fault.message, fault.expected) == (
        "run.duration",
        "got -1",
        "a number above 0 and at most 1e+06 [s]",
    )
    assert fault.source[:3] == (path, line(text, "duration = -1"), None)
    fault = refused(HOVER, "run.seed=1.5")
    assert (fault.key, fault.message) == ("run.seed", "got 1.5")
    assert fault.source == (None, None, "run.seed", "--set")
    assert str(pickle.loads(pickle.dumps(fault))) == str(fault)


def test_choices_are_listed():
    assert "rk4" in said(HOVER, "solver.integrator=rk5")
    assert "mpu6000" in said(DELIVERY, "sensors.imu.preset=none")
    assert "barometer" in said(DELIVERY, "sensors.compass={}")
    assert "random_wind_force" in said(HOVER, "effects.wind={}")
    assert "paper" in said(HOVER, "autopilot.gains=none")
    assert "delivery_drone" in said(HOVER, "vehicle.airframe=none")
    assert "unloading" in said(HOVER, "vehicle.model=none")
    assert "minimum_jerk" in said(HOVER, "trajectory.phase.0.z.kind=none")
    assert "autopilot" in said(HOVER, "nothing.here=1")
    assert "expected one of duration, name, release, x, y, yaw, z" in said(HOVER, "trajectory.phase.0.q=1")
    assert "MPC_XY_CRUISE" in said(HOVER, "autopilot.parameters.MPC_XY_CRUSE=1")


@pytest.mark.parametrize(
    ("override", "expected"),
    [
        ("run.seed", "--set run.seed: expected KEY=VALUE, for example solver.step=0.001"),
        ("=3", "--set =3: expected KEY=VALUE"),
        ("run.seed=", "--set run.seed=: expected KEY=VALUE"),
        ("run.seed=[1", "--set run.seed=[1: [1 is not a TOML value; quote a text"),
        ("run.seed.x=3", "--set run.seed.x=3: run.seed is a value, not a table"),
        ("vehicle.airframe.x=3", "--set vehicle.airframe.x=3: vehicle.airframe is a value, not a table"),
        ("run.seed=1.5", "--set run.seed: expected a whole number at least 0 and below 9.22337e+18, got 1.5"),
        ("run.duration=nan", "--set run.duration: expected a finite number, got nan"),
        ("run=3", "--set run: expected a table [run], got 3"),
        ("effects.gravity=3", "--set effects.gravity: expected a table [effects.gravity], got 3"),
        ("vehicle.name=1x", "--set vehicle.name: expected a text of the form"),
        ("communication.rate=300", "--set communication.rate: expected a rate with a whole number of ns"),
        ("rates.pose=33", "--set rates.pose: expected a rate that divides communication.rate = 250 Hz (250, 125, 50"),
        ("solver.step=0.003", "--set solver.step: expected a step that divides the exchange interval of 0.004 s"),
        ("published.rmse.q=3", "--set published.rmse.q: expected 'x', 'y'"),
        ("trajectory.phase=[]", "--set trajectory.phase: expected at least 1"),
        ("trajectory.phase.9.duration=1", "--set trajectory.phase.9.duration=1: expected an index from 0 to 3, got 9"),
        ("trajectory.phase.x.duration=1", "expected an index from 0 to 3, got x"),
        ("gains.altitude.3=1", "--set gains.altitude.3=1: expected an index from 0 to 2, got 3"),
        ("trajectory.phase.1.name=climb", "two phases are named 'climb'"),
        ("airframe.mass.total=-1", "--set airframe.mass.total: expected a number above 0 [kg], got -1"),
        ("airframe.mass.payload=11", "--set airframe.mass.payload: expected less than total = 10.0224 kg, got 11"),
        ("airframe.mass.totl=1", "--set airframe.mass.totl: unknown key 'totl'; did you mean total?"),
        ("gains.altitude=[1, 2]", "--set gains.altitude.2: missing; expected a number"),
        ("gains.tilt_limit=1.5", "--set gains.tilt_limit: expected a number above 0 and below 1.4 [rad], got 1.5"),
        ("autopilot.parameters=none.params", "--set autopilot.parameters: lapwing/scenes/none.params: no such file"),
        ("autopilot.parameters.MPC_TKO_SPEED=9", "MPC_TKO_SPEED: expected a number from 0.1 to 5, got 9"),
        ("autopilot.estimator=kalman", '--set autopilot.estimator: "kalman" needs [sensors.imu], [sensors.magneto'),
        ("autopilot.follow_trajectory=false", "--set autopilot.follow_trajectory: false leaves no source of setpoints"),
    ],
)
def test_bad_override_is_named(override, expected):
    assert expected in said(HOVER, override)


def test_fault_in_file_that_scene_names_is_named_with_its_line(write, tmp_path):
    path = write(TEXT)
    vehicle = tmp_path / "vehicles" / "delivery_drone.toml"
    sound = vehicle.read_text()
    vehicle.write_text(sound.replace("total = 10.0224", "total = -1.0"))
    number = line(vehicle.read_text(), "total")
    assert said(path) == f"{vehicle}:{number}: airframe.mass.total: expected a number above 0 [kg], got -1.0"
    vehicle.write_text("[mass\n")
    assert said(path).startswith(f"{vehicle}: not valid TOML: ")
    vehicle.write_bytes(b"\xff")
    assert "vehicle.airframe: " in said(path)
    vehicle.write_text(sound)
    own = tmp_path / "own.toml"
    own.write_text(
        Path("services/autopilot/gains/tuned.toml").read_text().replace("feed_forward = true", "feed_forward = 3")
    )
    number = line(own.read_text(), "feed")
    assert said(path, "autopilot.gains=own.toml").startswith(f"{own}:{number}: gains.feed_forward: ")


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("t,v\n0,0\n", ":1: expected the header time,value, got 't,v'"),
        ("time,value\n0,0\na,b\n", ":3: expected two numbers, got 'a,b'"),
        ("time,value\n0,0\n1\n", ":3: expected two numbers, got '1'"),
        ("time,value\n0,0\n1,inf\n", ":3: expected finite numbers, got '1,inf'"),
        ("time,value\n0,0\n0,1\n", ":3: expected times that start at 0 and ascend, got '0.0'"),
        ("time,value\n0,0\n", ":2: expected at least two points, got '1'"),
    ],
)
def test_fault_in_table_of_trajectory_is_named_with_its_line(write, tmp_path, text, expected):
    csv = tmp_path / "climb.csv"
    csv.write_text(text)
    fault = said(write(TEXT), 'trajectory.phase.0.z={kind="table", file="climb.csv"}')
    assert fault == f"{csv}{expected}"


def test_trajectory_tables_may_be_missing_or_inline():
    missing = said(HOVER, 'trajectory.phase.0.z={kind="table", file="none.csv"}')
    assert missing == "--set trajectory.phase.0.z.file: lapwing/scenes/none.csv: no such file or directory"
    values = 'trajectory.phase.0.z={kind="table", points=[[0.0, 0.0], [1.0, 1.0]]}'
    assert load(HOVER, [values])[Trajectory].phase[0].z[0].points == ((0.0, 0.0), (1.0, 1.0))
    later = values.replace("[0.0, 0.0]", "[0.5, 0.0]")
    assert "trajectory.phase.0.z.points.0.0: expected times that start at 0, got 0.5" in said(HOVER, later)
    above = values.replace("[0.0, 0.0]", "[0.0, 5.0]")
    assert "put a ramp or a step before it" in said(HOVER, above)


def test_files_that_are_no_scenes(tmp_path):
    assert "did you mean lapwing/scenes/hover.toml?" in said(Path("lapwing/scenes/hovr.toml"))
    assert "no such file or directory" in said(tmp_path / "none.toml")
    assert "is a folder" in said(tmp_path)
    (tmp_path / "damaged.toml").write_text("[run\nseed = 1\n")
    assert "not valid TOML" in said(tmp_path / "damaged.toml")
    (tmp_path / "binary.toml").write_bytes(b"\xff\xfe")
    assert "not valid TOML: not a UTF-8 text file" in said(tmp_path / "binary.toml")


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
        "run",
        "communication",
        "vehicle",
        "solver",
        "sensors",
        "autopilot",
        "trajectory",
        "airframe",
        "gains",
    } <= set(vocabulary().sections)


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
