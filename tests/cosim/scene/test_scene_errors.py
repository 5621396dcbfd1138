"""Errors of scenes and overrides: named with file, line, key and choices."""

import pickle
from pathlib import Path

import pytest

from lapwing.cosim.scene import SceneError
from lapwing.services.scene_resolver import load
from lapwing.services.trajectory.schema import Trajectory

HOVER, DELIVERY = Path("lapwing/scenes/hover.toml"), Path("lapwing/scenes/delivery_mission.toml")
TEXT = HOVER.read_text()


def scene_error(path, *overrides):
    with pytest.raises(SceneError) as caught:
        load(path, overrides)
    assert "\n" not in str(caught.value)
    return caught.value


def error_text(path, *overrides):
    return str(scene_error(path, *overrides)).removeprefix(f"{path}:")


def line(text, part):
    """Return the number of the first line that starts with `part`."""
    return next(n for n, line in enumerate(text.splitlines(), 1) if line.startswith(part))


@pytest.mark.parametrize(
    ("old", "new", "at", "expected"),
    [
        ("seed = 1", "sed = 1", "sed", "run.sed: unknown key 'sed'; did you mean seed?"),
        ("[run]", "[rnu]", "[rnu]", "rnu: unknown table 'rnu'; did you mean run?"),
        ("duration = 20.0", 'duration = "20"', 'duration = "20"', "run.duration: expected a number above 0 and "),
        ("duration = 20.0", "duration = true", "duration = true", ", got True"),
        ("duration = 20.0", "", "[run]", "run.duration: missing; expected a number"),
        ("duration = 20.0", "duration = -1", "duration = -1", "above 0 and at most 1e+06 [s], got -1"),
        ("[effects.gravity]", "[effects.gravy]", "[effects.gravy]", "unknown effect 'gravy'; did you mean gravity?"),
        ('gains = "tuned"', 'gains = "tune"', "gains", "autopilot.gains: unknown gain set 'tune'; did you mean tuned?"),
        ('"delivery_drone"', '"delivery"', "airframe", "unknown airframe 'delivery'; did you mean delivery_d"),
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
def test_error_has_line_and_key(write, old, new, at, expected):
    assert old in TEXT
    text = TEXT.replace(old, new, 1)
    fault = error_text(write(text))
    assert fault.startswith(f"{line(text, at)}: ")
    assert expected in fault


def test_error_has_value(write):
    text = TEXT.replace("duration = 20.0", "duration = -1")
    path = write(text)
    fault = scene_error(path)
    assert (fault.key, fault.message, fault.expected) == (
        "run.duration",
        "got -1",
        "a number above 0 and at most 1e+06 [s]",
    )
    assert fault.source[:3] == (path, line(text, "duration = -1"), None)
    fault = scene_error(HOVER, "run.seed=1.5")
    assert (fault.key, fault.message) == ("run.seed", "got 1.5")
    assert fault.source == (None, None, "run.seed", "override")
    assert str(pickle.loads(pickle.dumps(fault))) == str(fault)


def test_choices_are_listed():
    assert "rk4" in error_text(HOVER, "solver.integrator=rk5")
    assert "mpu6000" in error_text(DELIVERY, "sensors.imu.preset=none")
    assert "barometer" in error_text(DELIVERY, "sensors.compass={}")
    assert "random_wind_force" in error_text(HOVER, "effects.wind={}")
    assert "paper" in error_text(HOVER, "autopilot.gains=none")
    assert "delivery_drone" in error_text(HOVER, "vehicle.airframe=none")
    assert "unloading" in error_text(HOVER, "vehicle.model=none")
    assert "minimum_jerk" in error_text(HOVER, "trajectory.phase.0.z.kind=none")
    assert "autopilot" in error_text(HOVER, "nothing.here=1")
    assert "expected one of duration, name, release, x, y, yaw, z" in error_text(HOVER, "trajectory.phase.0.q=1")
    assert "MPC_XY_CRUISE" in error_text(HOVER, "autopilot.parameters.MPC_XY_CRUSE=1")


@pytest.mark.parametrize(
    ("override", "expected"),
    [
        ("run.seed", "override run.seed: expected KEY=VALUE, for example solver.step=0.001"),
        ("=3", "override =3: expected KEY=VALUE"),
        ("run.seed=", "override run.seed=: expected KEY=VALUE"),
        ("run.seed=[1", "override run.seed=[1: [1 is not a TOML value; quote a text"),
        ("run.seed.x=3", "override run.seed.x=3: run.seed is a value, not a table"),
        ("vehicle.airframe.x=3", "override vehicle.airframe.x=3: vehicle.airframe is a value, not a table"),
        ("run.seed=1.5", "override run.seed: expected a whole number at least 0 and below 9.22337e+18, got 1.5"),
        ("run.duration=nan", "override run.duration: expected a finite number, got nan"),
        ("run=3", "override run: expected a table [run], got 3"),
        ("effects.gravity=3", "override effects.gravity: expected a table, {} for its defaults, or false, got 3"),
        ("vehicle.name=1x", "override vehicle.name: expected a text of the form"),
        ("communication.rate=300", "override communication.rate: expected a rate with a whole number of ns"),
        (
            "rates.pose=33",
            "override rates.pose: expected a rate that divides communication.rate = 250 Hz (250, 125, 50",
        ),
        ("solver.step=0.003", "override solver.step: expected a step that divides the communication step of 0.004 s"),
        ("published.rmse.q=3", "override published.rmse.q: expected 'x', 'y'"),
        ("trajectory.phase=[]", "override trajectory.phase: expected at least 1"),
        (
            "trajectory.phase.9.duration=1",
            "override trajectory.phase.9.duration=1: expected an index from 0 to 3, got 9",
        ),
        ("trajectory.phase.x.duration=1", "expected an index from 0 to 3, got x"),
        ("gains.altitude.3=1", "override gains.altitude.3=1: expected an index from 0 to 2, got 3"),
        ("trajectory.phase.1.name=climb", "two phases are named 'climb'"),
        ("airframe.mass.total=-1", "override airframe.mass.total: expected a number above 0 [kg], got -1"),
        ("airframe.mass.payload=11", "override airframe.mass.payload: expected less than total = 10.0224 kg, got 11"),
        ("airframe.mass.totl=1", "override airframe.mass.totl: unknown key 'totl'; did you mean total?"),
        ("gains.altitude=[1, 2]", "override gains.altitude.2: missing; expected a number"),
        (
            "gains.tilt_limit=1.5",
            "override gains.tilt_limit: expected a number above 0 and below 1.4 [rad], got 1.5",
        ),
        ("autopilot.parameters=none.params", "override autopilot.parameters: lapwing/scenes/none.params: no such file"),
        ("autopilot.parameters.MPC_TKO_SPEED=9", "MPC_TKO_SPEED: expected a number from 0.1 to 5, got 9"),
        ("autopilot.estimator=kalman", 'override autopilot.estimator: "kalman" needs [sensors.imu], [sensors.magneto'),
        (
            "autopilot.follow_trajectory=false",
            "override autopilot.follow_trajectory: false leaves no source of setpoints",
        ),
    ],
)
def test_bad_override_is_named(override, expected):
    assert expected in error_text(HOVER, override)


def test_error_in_named_file_has_line(write, tmp_path):
    path = write(TEXT)
    vehicle = tmp_path / "vehicles" / "delivery_drone.toml"
    sound = vehicle.read_text()
    vehicle.write_text(sound.replace("total = 10.0224", "total = -1.0"))
    number = line(vehicle.read_text(), "total")
    assert error_text(path) == f"{vehicle}:{number}: airframe.mass.total: expected a number above 0 [kg], got -1.0"
    vehicle.write_text("[mass\n")
    assert error_text(path).startswith(f"{vehicle}: not valid TOML: ")
    vehicle.write_bytes(b"\xff")
    assert "vehicle.airframe: " in error_text(path)
    vehicle.write_text(sound)
    own = tmp_path / "own.toml"
    own.write_text(
        Path("services/autopilot/gains/tuned.toml").read_text().replace("feed_forward = true", "feed_forward = 3")
    )
    number = line(own.read_text(), "feed")
    assert error_text(path, "autopilot.gains=own.toml").startswith(f"{own}:{number}: gains.feed_forward: ")


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
def test_error_in_trajectory_table_has_line(write, tmp_path, text, expected):
    csv = tmp_path / "climb.csv"
    csv.write_text(text)
    fault = error_text(write(TEXT), 'trajectory.phase.0.z={kind="table", file="climb.csv"}')
    assert fault == f"{csv}{expected}"


def test_trajectory_tables_may_be_missing_or_inline():
    missing = error_text(HOVER, 'trajectory.phase.0.z={kind="table", file="none.csv"}')
    assert missing == "override trajectory.phase.0.z.file: lapwing/scenes/none.csv: no such file or directory"
    values = 'trajectory.phase.0.z={kind="table", points=[[0.0, 0.0], [1.0, 1.0]]}'
    assert load(HOVER, [values])[Trajectory].phase[0].z[0].points == ((0.0, 0.0), (1.0, 1.0))
    later = values.replace("[0.0, 0.0]", "[0.5, 0.0]")
    assert "trajectory.phase.0.z.points.0.0: expected times that start at 0, got 0.5" in error_text(HOVER, later)
    above = values.replace("[0.0, 0.0]", "[0.0, 5.0]")
    assert "put a ramp or a step before it" in error_text(HOVER, above)


def test_other_files_are_rejected_as_scenes(tmp_path):
    assert "did you mean lapwing/scenes/hover.toml?" in error_text(Path("lapwing/scenes/hovr.toml"))
    assert "no such file or directory" in error_text(tmp_path / "none.toml")
    assert "is a folder" in error_text(tmp_path)
    (tmp_path / "damaged.toml").write_text("[run\nseed = 1\n")
    assert "not valid TOML" in error_text(tmp_path / "damaged.toml")
    (tmp_path / "binary.toml").write_bytes(b"\xff\xfe")
    assert "not valid TOML: not a UTF-8 text file" in error_text(tmp_path / "binary.toml")
    (tmp_path / "flight.mcap").write_bytes(b"\x89MCAP0\r\n\x01")
    assert "is a log (MCAP); expected a scene file (TOML)" in error_text(tmp_path / "flight.mcap")


def test_false_switches_an_effect_or_a_sensor_off():
    scene = load("delivery_full", ["effects.ground_contact=false", "sensors.sonar=false"])
    assert "ground_contact" not in scene.tables("effects")
    assert "gravity" in scene.tables("effects")
    assert set(scene.tables("sensors")) == {"barometer", "gps", "imu", "magnetometer"}


@pytest.mark.parametrize(
    ("override", "expected"),
    [
        ("effects.bodydrag=false", "effects.bodydrag: unknown effect 'bodydrag'; did you mean body_drag?"),
        ("sensors.sonr=false", "sensors.sonr: unknown sensor 'sonr'; did you mean sonar?"),
        ("effects.gravity=true", "effects.gravity: expected a table, {} for its defaults, or false, got True"),
    ],
)
def test_only_known_entries_are_switched_off(override, expected):
    assert expected in error_text(DELIVERY, override)
