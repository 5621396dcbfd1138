import json
import tomllib
from dataclasses import replace

import numpy as np
import pytest
from flight_recordings import INTERVAL, simulated, write_csv

from lapwing import BatchSimulator, posterior
from lapwing.cosim.scene.toml_text import dump
from lapwing.services.scene_resolver import load_one
from lapwing.studies.identification.output_error import Fit, OutputError
from lapwing.studies.identification.procedure import (
    Identification,
    identify,
    joint_distribution,
    start_value,
    write_airframe,
)
from lapwing.studies.validation.plant_rows import PlantRows
from lapwing.studies.validation.start_states import NO_TRIM
from tests.combinations import rest_nightly
from tests.commands import assert_rejected, run_command

SCENE = "crazyflie_21"
KEYS = (
    "effects.rotor_quadratic.thrust_constant",
    "airframe.motor.time_constant",
    "effects.h_force.coefficient",
    "airframe.mass.inertia.0",
)
TRUE = {key: start_value(load_one(SCENE, ()), key) for key in KEYS}


@pytest.fixture(scope="module")
def plant():
    return PlantRows(SCENE, INTERVAL)


def estimate(flight, windows=60):
    start = [1.05 * value for value in TRUE.values()]
    fit = OutputError(PlantRows(SCENE, INTERVAL), [flight], list(TRUE), start, windows, NO_TRIM).solve(most=12)
    return fit, (fit.values - np.array(list(TRUE.values()))) / fit.standard_errors


@pytest.mark.long
def test_true_values_lie_within_standard_errors(plant):
    deviations = np.array([estimate(flight)[1] for flight in simulated(plant, 8.0, [1, 2])])
    assert (np.abs(deviations) < 4.0).all()
    assert np.mean(np.abs(deviations) < 2.0) >= 0.75


@pytest.mark.long
def test_estimate_repeats_for_one_seed(plant):
    (flight,) = simulated(plant, 4.0, [4])
    fits = [
        OutputError(PlantRows(SCENE, INTERVAL), [flight], list(TRUE)[:2], [1.7e-8, 0.06], 20, NO_TRIM).solve(most=3)
        for _ in range(2)
    ]
    assert np.array_equal(fits[0].values, fits[1].values)


@pytest.mark.long
def test_parameter_without_influence_is_reported(plant):
    (flight,) = simulated(plant, 4.0, [1])
    keys = ["effects.rotor_quadratic.thrust_constant", "airframe.motor.no_load_current"]
    problem = OutputError(PlantRows(SCENE, INTERVAL), [flight], keys, [1.75e-8, 0.05], 20, NO_TRIM)
    assert problem.solve(most=4).undetermined == ("airframe.motor.no_load_current",)


@pytest.mark.long
def test_grounded_flights_are_rejected(plant, tmp_path):
    (flight,) = simulated(plant, 2.0, [1])
    flight.position[:, 2] = 0.05
    path = write_csv(tmp_path / "flight.csv", flight)
    with pytest.raises(ValueError, match="leave the ground"):
        identify(SCENE, [path], "nanobench", list(TRUE), NO_TRIM)


def test_parameters_of_recordings_are_not_for_the_scene(tmp_path):
    keys = ("flight.command_delay", "effects.h_force.coefficient")
    fit = Fit(keys, np.zeros(2), np.array([0.01, 1e-6]), np.ones(2), np.eye(2), 1.0, 1, ())
    result = Identification(SCENE, fit, ("a",), (), (), None, None)
    write_airframe(tmp_path / "mine.toml", SCENE, result)
    assert tomllib.loads((tmp_path / "mine.toml").read_text())["posterior"]["keys"] == [keys[1]]
    lines = (tmp_path / "mine.toml").read_text().splitlines()
    assert "#   effects.h_force.coefficient = 1e-06" in lines
    assert not any(line.startswith("#   flight.") for line in lines)


def test_vague_positive_parameters_are_not_drawn():
    keys = ("airframe.motor.time_constant", "effects.h_force.coefficient", "effects.body_wrench.force.0")
    start, errors = np.array([0.05, 1e-6, 0.0]), np.array([0.04, 1e-7, 2.0])
    correlations = np.array([[1.0, 0.9, 0.1], [0.9, 1.0, -0.3], [0.1, -0.3, 1.0]])
    content = joint_distribution(Fit(keys, start, start, errors, correlations, 1.0, 1, ()))["posterior"]
    assert content["keys"] == list(keys[1:])
    assert content["distributions"] == ["lognormal", "normal"]
    assert np.array(content["covariance"]) == pytest.approx(np.array([[1e-14, -6e-8], [-6e-8, 4.0]]))


def test_toml_of_nested_tables_reads_back():
    tables = {"mesh": "a.stl", "mass": {"total": 1.5e-3, "inertia": [1e-5, 2.0, 3.0], "deep": {"flag": True}}}
    assert tomllib.loads(dump(tables)) == tables


@pytest.mark.long
def test_command_writes_airframe_with_provenance(plant, tmp_path):
    recordings = simulated(plant, 4.0, [1, 2, 3])
    paths = [write_csv(tmp_path / f"{f.name}.csv", f) for f in recordings]
    paths.append(write_csv(tmp_path / "copy.csv", recordings[0]))
    grounded = replace(recordings[0], position=recordings[0].position * [1.0, 1.0, 0.0])
    paths.append(write_csv(tmp_path / "grounded.csv", grounded))
    out, figures = tmp_path / "mine.toml", tmp_path / "mine.json"
    done = run_command(
        "identify", SCENE, *paths, "--mapping", "nanobench", "--free",
        "airframe.motor.time_constant,effects.h_force.coefficient", "--out", out, "--json", figures,
        "--windows", "60", "--trim-force", "0", "--trim-torque", "0", "--seed", "3", "--horizons", "10,50",
        "--set", "airframe.motor.time_constant=0.08", code=0)  # fmt: skip
    assert not done.stderr
    assert "rate [rad/s]" in done.stdout
    assert "nan" not in done.stdout  # power, which is not measured
    true = TRUE["airframe.motor.time_constant"]
    assert tomllib.loads(out.read_text())["motor"]["time_constant"] == pytest.approx(true, rel=0.1)
    assert "Identified by output error from 2 flights" in out.read_text()
    assert len(json.loads(figures.read_text())["held_out"]) == 1
    assert f"left out: copy: the same flight as {recordings[0].name}" in done.stdout
    assert "left out: grounded: never leaves the ground, the height changes by 0.00 m" in done.stdout
    assert not out.with_name("mine.toml.progress").exists()
    content = json.loads(figures.read_text())
    lines = done.stdout.splitlines()
    assert any(f"estimates on 1 held-out flight: {content['verdict']['text']}" in line for line in lines)
    assert content["posterior"]["keys"] == list(content["parameters"])
    assert content["posterior"] == tomllib.loads(out.read_text())["posterior"]
    short = ("--set", "run.duration=0.5", "--set", "success.require=[]", "--runs", "3", "--csv")
    done = run_command("campaign", SCENE, "--vary", out, *short, "--out", tmp_path / "flown", code=0)
    table = np.genfromtxt(tmp_path / "flown" / "runs.csv", delimiter=",", names=True, deletechars="", dtype=None)
    batch = BatchSimulator(SCENE, 3, posterior(out))
    batch.step(np.full((3, 4), 3.0), ticks=10)
    assert len(set(batch.state.rotor_speed[:, 0])) == 3  # the time constants differ
    for key, mean, variances in zip(
        content["posterior"]["keys"], content["posterior"]["mean"], content["posterior"]["covariance"], strict=True
    ):
        assert len(set(table[key])) == 3
        deviation = max(variances) ** 0.5 if key.endswith("time_constant") else np.inf
        assert np.abs(table[key] - mean).max() < 4.0 * deviation
    assert_rejected(
        run_command(
            "campaign", SCENE, "--vary", f"{key}=normal(1,1)", "--vary", out, *short, "--out", tmp_path / "other"
        ),
        f"{key} already has a distribution",
    )


@pytest.mark.long
@pytest.mark.parametrize(
    ("free", "message"),
    rest_nightly(
        ("airframe.motor.colour", "no number of this name"),
        ("airframe.mass.totl", "did you mean airframe.mass.total?"),
        ("effects.h_force.coeficient", "did you mean effects.h_force.coefficient?"),
        ("flight.comand_delay", "did you mean flight.command_delay?"),
        ("zzz", "use a key that the scene"),
        ("a,a", "contains a key twice"),
        ("", "--free: missing"),
        keep=2,
    ),
)
def test_command_rejects_unknown_parameters(plant, tmp_path, free, message):
    path = write_csv(tmp_path / "flight.csv", simulated(plant, 2.0, [1])[0])
    done = run_command(
        "identify", SCENE, path, "--mapping", "nanobench", "--free", free, "--out", tmp_path / "out.toml", code=2
    )
    assert message in done.stderr
    assert not (tmp_path / "out.toml").exists()
