"""Scenes: what they hold, what `--set` changes, and that a fault is named with file, line, key and choices."""

import shutil
from pathlib import Path

import pytest

from services.scene import Scene, SceneError, load, sections
from services.sections import Exchange, Run, Vehicle
from services.trajectory.config import Trajectory

HOVER, DELIVERY = Path("scenes/hover.toml"), Path("scenes/delivery_mission.toml")
TEXT = HOVER.read_text()


@pytest.fixture
def write(tmp_path):
    """Writes a scene file beside a copy of the airframes."""
    shutil.copytree("scenes/vehicles", tmp_path / "vehicles")

    def write_(text):
        path = tmp_path / "scene.toml"
        path.write_text(text)
        return path

    return write_


def said(path, *overrides):
    with pytest.raises(SceneError) as caught:
        load(path, overrides)
    text = str(caught.value)
    assert "\n" not in text
    return text.removeprefix(f"{path}:")


def line(text, part):
    """Number of the first line that starts with `part`."""
    return next(n for n, line in enumerate(text.splitlines(), 1) if line.startswith(part))


@pytest.mark.parametrize("path", sorted(Path("scenes").glob("*.toml")), ids=str)
def test_every_scene_is_valid_and_has_a_title(path):
    scene = load(path)
    assert isinstance(scene, Scene)
    assert scene[Run].title
    assert scene.name == path.stem


def test_settings_by_class_and_by_key():
    scene = load(DELIVERY)
    assert scene[Exchange].rate == scene.lookup("exchange.rate") == 250
    assert scene[Exchange].interval_ns == 4_000_000
    assert scene.lookup("sensors.gps.rate") > 0


def test_overrides_change_values_add_tables_and_reach_into_lists():
    overrides = ["run.seed=7", "exchange.coupling=parallel", "effects.rotor_gyro={}", "trajectory.phase.1.duration=2"]
    scene = load(HOVER, overrides)
    assert scene[Run].seed == 7
    assert scene[Exchange].loop_delay == 2
    assert "rotor_gyro" in scene.tables("effects")
    assert scene[Trajectory].phase[1].duration == 2.0


def test_a_whole_number_will_do_for_a_real_one_and_spaces_around_the_sign_do_no_harm():
    assert load(HOVER, ["run.duration = 3"])[Run].duration == 3.0


def test_the_recorded_text_tells_the_overrides():
    assert load(HOVER, ["run.seed=7"]).text == TEXT + "\n# --set run.seed=7\n"
    assert load(HOVER).text == TEXT


@pytest.mark.parametrize(
    ("old", "new", "at", "expected"),
    [
        ("seed = 1", "sed = 1", "sed", "run.sed: unknown key; did you mean seed?"),
        ("[run]", "[rnu]", "[rnu]", "rnu: unknown table; did you mean run?"),
        ("duration = 20.0", 'duration = "20"', 'duration = "20"', "run.duration: expected a number, got '20'"),
        ("duration = 20.0", "duration = true", "duration = true", "run.duration: expected a number, got True"),
        ("duration = 20.0", "", "[run]", "run.duration: missing; expected a number"),
        ("duration = 20.0", "duration = -1", "duration = -1", "run.duration: expected a number above 0, got -1"),
        ("[effects.gravity]", "[effects.gravy]", "[effects.gravy]", "effects.gravy: unknown effect 'gravy'"),
        ('gains = "tuned"', 'gains = "tune"', "gains", "autopilot.gains: unknown gain set 'tune'"),
        ('"delivery_drone"', '"delivery"', "airframe", "vehicle.airframe: no file"),
        ("duration = 2.0", "length = 2.0", "length", "trajectory.phase.3.length: unknown key"),
        ('z = { kind = "minimum_jerk", to = 0.0', 'z = { kind = "jerk", to = 0.0', 'z = { kind = "jerk"', "phase.2.z"),
    ],
)
def test_a_fault_is_named_with_its_line_and_key(write, old, new, at, expected):
    assert old in TEXT
    text = TEXT.replace(old, new, 1)
    fault = said(write(text))
    assert fault.startswith(f"{line(text, at)}: ")
    assert expected in fault


def test_choices_are_listed():
    assert "rk4" in said(HOVER, "solver.integrator=rk5")
    assert "mpu6000" in said(DELIVERY, "sensors.imu.preset=none")
    assert "barometer" in said(DELIVERY, "sensors.compass={}")
    assert "wind_random" in said(HOVER, "effects.wind={}")
    assert "paper" in said(HOVER, "autopilot.gains=none")
    assert "delivery_drone" in said(HOVER, "vehicle.airframe=none")
    assert "minimum_jerk" in said(HOVER, "trajectory.phase.0.z.kind=none")
    assert "autopilot" in said(HOVER, "nothing.here=1")
    assert "(keys: duration, name, x, y, yaw, z)" in said(HOVER, "trajectory.phase.0.q=1")


@pytest.mark.parametrize(
    ("override", "expected"),
    [
        ("run.seed", "--set run.seed: expected KEY=VALUE, for example solver.step=0.001"),
        ("=3", "--set =3: expected KEY=VALUE"),
        ("run.seed=", "--set run.seed=: expected KEY=VALUE"),
        ("run.seed=[1", "--set run.seed=[1: [1 is not a TOML value; quote a text"),
        ("run.seed.x=3", "--set run.seed.x=3: run.seed is a value, not a table"),
        ("run.seed=1.5", "--set run.seed: expected a whole number, got 1.5"),
        ("run.duration=nan", "--set run.duration: expected a finite number, got nan"),
        ("run=3", "--set run: expected a table [run], got 3"),
        ("vehicle.name=1x", "--set vehicle.name: expected a text of the form"),
        ("exchange.rate=300", "--set exchange.rate: expected a rate whose interval is a whole number of ns"),
        ("rates.pose=33", "--set rates.pose: expected a rate that divides exchange.rate = 250 Hz (250, 125, 50"),
        ("solver.step=0.003", "--set solver.step: expected a step that divides the exchange interval of 0.004 s"),
        ("published.rmse.q=3", "--set published.rmse.q: expected 'x', 'y'"),
        ("trajectory.phase=[]", "--set trajectory.phase: expected at least 1"),
        ("trajectory.phase.9.duration=1", "expected an index from 0 to 3, got 9"),
        ("trajectory.phase.x.duration=1", "expected an index from 0 to 3, got x"),
        ("trajectory.phase.1.name=climb", "two phases are named 'climb'"),
    ],
)
def test_a_bad_override_is_named(override, expected):
    assert expected in said(HOVER, override)


def test_a_negative_mass_is_named_with_the_airframes_file(write):
    path = write(TEXT)
    vehicle = path.parent / "vehicles" / "delivery_drone.toml"
    vehicle.write_text(vehicle.read_text().replace("total = 10.0224", "total = -1.0"))
    with pytest.raises(SceneError, match=rf"{vehicle}.*mass.total.*got -1\.0"):
        load(path)


def test_files_that_are_no_scenes(tmp_path):
    assert "did you mean scenes/hover.toml?" in said(Path("scenes/hovr.toml"))
    assert "no such file or directory" in said(tmp_path / "none.toml")
    assert "is a folder" in said(tmp_path)
    (tmp_path / "damaged.toml").write_text("[run\nseed = 1\n")
    assert "not valid TOML" in said(tmp_path / "damaged.toml")
    (tmp_path / "binary.toml").write_bytes(b"\xff\xfe")
    assert "not valid TOML: not a UTF-8 text file" in said(tmp_path / "binary.toml")


def test_an_airframe_may_be_a_file_beside_the_scene(write):
    path = write(TEXT.replace('"delivery_drone"', '"vehicles/delivery_drone.toml"'))
    assert load(path)[Vehicle].airframe == "vehicles/delivery_drone.toml"


def test_each_table_is_declared_once():
    assert {"run", "exchange", "vehicle", "solver", "sensors", "autopilot", "trajectory"} <= set(sections())
