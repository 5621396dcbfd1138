import json
import math
import zipfile
from pathlib import Path

import numpy as np
import pytest
from recorded_ports import RecordedPorts, scene_config
from truth_digest import digest_of_rows

pytest.importorskip("fmpy")
from driven_fmu import Slave
from fmpy import read_model_description, simulate_fmu
from fmpy.validation import validate_fmu

from lapwing.fmi.export.exported_part import export_part
from lapwing.fmi.export.fmu import export_fmu
from lapwing.fmi.export.variables import Variable, variables_of
from tests.combinations import rest_nightly
from tests.commands import assert_rejected, run_command


def input_signals(recorded: RecordedPorts, part: str) -> np.ndarray:
    """Return the recorded inputs for FMPy: at time k the samples that tick k + 1 reads."""
    exported = export_part(recorded.config, part)
    variables = [v for v in variables_of(exported) if v.causality == "input"]
    kinds = {"real": np.float64, "integer": np.int32, "boolean": np.bool_}
    signals = np.zeros(recorded.ticks, [("time", np.float64), *((v.name, kinds[v.type]) for v in variables)])
    signals["time"] = np.arange(recorded.ticks) * recorded.config.interval
    for k in range(recorded.ticks):
        row = [recorded.latest(p.port.name, k + 1 - p.lag if k + 1 < recorded.ticks else k) for p in exported.inputs]
        values = np.concatenate(row) if row else np.zeros(0)
        for v in variables:
            signals[v.name][k] = values[v.offset]
    return signals


def assert_outputs_equal(recorded: RecordedPorts, part: str, result: np.ndarray) -> None:
    exported = export_part(recorded.config, part)
    for v in variables_of(exported):
        if v.causality == "output" and v.name in (result.dtype.names or ()):
            port = exported.outputs[v.port].port.name
            expected = np.array([recorded.latest(port, k)[v.offset] for k in range(len(result))])
            assert np.array_equal(result[v.name].astype(float), expected, equal_nan=True), v.name


@pytest.fixture(scope="module", params=[2, 3])
def plant(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("fmu") / "hover_plant.fmu"
    options = ["--fmi", str(request.param), "--cpu", "x86-64-v3", "--set", "run.duration=2.0"]
    done = run_command("export-fmu", "hover", "--part", "plant", "--out", path, *options, code=0)
    assert f"FMI {request.param}.0" in done.stdout
    return path


@pytest.mark.long
def test_plant_has_recorded_outputs_bit_for_bit(plant: Path) -> None:
    assert validate_fmu(str(plant)) == []
    recorded = RecordedPorts(scene_config("hover", **{"run.duration": 2.0}))
    names = [v.name for v in read_model_description(str(plant)).modelVariables if v.causality == "output"]
    result = simulate_fmu(
        str(plant), input=input_signals(recorded, "plant"), output=names, stop_time=2.0, output_interval=0.004
    )
    assert len(result) == recorded.ticks == 501
    assert_outputs_equal(recorded, "plant", result)


def test_archive_has_description_binary_and_documentation(plant: Path) -> None:
    with zipfile.ZipFile(plant) as archive:
        assert {"modelDescription.xml", "documentation/index.html", "resources/run_config.json"} <= set(
            archive.namelist()
        )
        assert "motor_voltage" in archive.read("documentation/index.html").decode()
        json.loads(archive.read("resources/run_config.json"))
    model = read_model_description(str(plant))
    units = {v.name: v.unit for v in model.modelVariables}
    assert units["truth.velocity_world[0]"] == "m/s"
    assert units["actuators.motor_voltage[3]"] == "V"
    assert model.defaultExperiment.stepSize == "0.004"


@pytest.mark.long
@pytest.mark.parametrize(
    ("effect", "columns"),
    [
        (None, ["voltage", "current"]),
        ("battery", ["charge", "voltage", "current"]),
        ("battery_thevenin", ["charge", "voltage", "current", "temperature"]),
    ],
)
def test_variables_without_model_are_left_out(effect: str | None, columns: list[str]) -> None:
    """They would be NaN, which importers reject or plot as gaps."""
    config = scene_config("hover", **({f"effects.{effect}": "{}"} if effect else {}))
    for part, causality in (("plant", "output"), ("autopilot", "input")):
        variables = variables_of(export_part(config, part))
        names = [v.name for v in variables if v.name.startswith("battery.")]
        assert names == [f"battery.{each}" for each in columns]
        assert {v.causality for v in variables if v.name in names} == {causality}
        assert all(math.isfinite(v.start) for v in variables if v.start is not None and v.causality == "input")


HEIGHT, MOTOR = "truth.position_world[2]", "actuators.motor_voltage[0]"
START = "state.plant.vehicle.motion.position_world[2]"


def test_instances_are_independent_and_states_move_between_them(plant: Path) -> None:
    a, b = Slave(plant, "a"), Slave(plant, "b")
    a.begin(**{START: 100.0})
    b.begin()
    for _ in range(50):
        a.step()
        b.step()
    assert a.get(HEIGHT) < 100.0
    assert b.get(HEIGHT) == pytest.approx(0.35, abs=1e-3)
    state, height = a.saved(), a.get(HEIGHT)
    assert a.saved() == state
    b.load(state)
    assert b.get(HEIGHT) == height
    a.step(0.1)
    b.time = a.time - 0.1
    for _ in range(25):
        b.step()
    assert a.get(HEIGHT) == b.get(HEIGHT)
    with pytest.raises(Exception, match=r"."):
        a.load(state[:-1] if a.is_3 else b"x" * len(state))
    a.close()
    b.close()


def test_free_fall_has_its_closed_form(plant: Path) -> None:
    a = Slave(plant)
    a.set("parameters.plant.vehicle.effects.gravity.acceleration", 2.0)
    a.begin(**{START: 50.0})
    a.step(1.0)
    assert a.get(HEIGHT) == pytest.approx(49.0, abs=1e-6)
    with pytest.raises(Exception, match=r"."):
        a.set(START, 10.0)  # a start value after initialisation
    a.close()


def test_late_start_has_ticks_of_early_one(plant: Path) -> None:
    a, b = Slave(plant, "a"), Slave(plant, "b")
    b.time = 1.7e9  # [s] Unix time, of which doubles have 0.24 us
    for each in (a, b):
        each.begin(**{START: 50.0})
    for _ in range(250):
        a.step()
        b.step()
        assert a.get(HEIGHT) == b.get(HEIGHT)
    a.close()
    b.close()


def test_steps_shorter_than_internal_one_hold_outputs(plant: Path) -> None:
    a, b = Slave(plant, "a"), Slave(plant, "b")
    a.begin(**{START: 50.0})
    b.begin(**{START: 50.0})
    for _ in range(10):
        a.step(0.001)
    b.step(0.008)
    assert a.get(HEIGHT) == b.get(HEIGHT)
    a.close()
    b.close()


def test_wrong_step_is_error_not_crash(plant: Path) -> None:
    a = Slave(plant)
    a.begin()
    for time, size in ((1.0, 0.004), (0.0, -1.0), (0.0, math.nan), (math.inf, 0.004), (0.0, 1e300)):
        with pytest.raises(Exception, match=r"."):
            a.fmu.doStep(currentCommunicationPoint=time, communicationStepSize=size)
    a.step()
    a.close()


def truth_rows(result: np.ndarray, variables: list[Variable]) -> np.ndarray:
    names = [v.name for v in variables if v.name.startswith("truth.")]
    return np.ascontiguousarray(np.column_stack([result[name].astype(float) for name in names]))


@pytest.mark.parametrize("scene", ["hover", pytest.param("delivery_mission", marks=pytest.mark.long)])
@pytest.mark.parametrize("version", rest_nightly(3, 2))
def test_vehicle_has_truth_digest_of_run(scene: str, version: int, tmp_path: Path) -> None:
    recorded = RecordedPorts(scene_config(scene))
    path = tmp_path / "vehicle.fmu"
    variables = variables_of(export_fmu(recorded.config, "vehicle", path, version))
    assert validate_fmu(str(path)) == []
    assert path.stat().st_size < 2e6
    names = [v.name for v in variables if v.name.startswith("truth.")]
    stop = (recorded.ticks - 1) * recorded.config.interval
    result = simulate_fmu(str(path), output=names, stop_time=stop, output_interval=recorded.config.interval)
    assert len(result) == recorded.ticks
    expected = np.array([recorded.sample("truth", k) for k in range(recorded.ticks)])
    rows = truth_rows(result, variables)
    assert digest_of_rows(recorded.config, rows) == digest_of_rows(recorded.config, expected)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--fmi", "1"], "--fmi 1: unknown version; use 2 or 3"),
        (["--part", "wing"], "--part wing: unknown; use one of plant, sensors, autopilot, trajectory, vehicle"),
        (["--set", "vehicle.nam=1"], "unknown key"),
    ],
)
def test_invalid_export_is_rejected_in_one_line(arguments: list[str], message: str, tmp_path: Path) -> None:
    out = tmp_path / "x.fmu"
    assert_rejected(run_command("export-fmu", "hover", "--out", out, *arguments), message)
    assert not out.exists()


def test_export_without_compiler_is_rejected(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CC", "no-such-compiler")
    done = run_command("export-fmu", "hover", "--out", tmp_path / "x.fmu", code=2)
    assert done.stderr == "lapwing: CC=no-such-compiler: no such program; name a C compiler, or unset CC\n"
    done = run_command("export-fmu", "hover", "--out", tmp_path / "x.zip", code=2)
    assert "use a name that ends in .fmu" in done.stderr
