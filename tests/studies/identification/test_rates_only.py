"""Identification from logs without positions: gyroscope, accelerometer and motor commands of a known vehicle."""

import json
from dataclasses import replace
from pathlib import Path

import flight_writers
import numpy as np
import pytest
from flight_recordings import BATTERY, INTERVAL, simulated

from lapwing.flights.log_import.open_flight import open_flight
from lapwing.services.scene_resolver import load_one
from lapwing.studies.identification.procedure import start_value
from lapwing.studies.validation.plant_rows import PlantRows
from lapwing.studies.validation.start_states import unknown_parameters, unmeasured_motion, with_made_up_motion
from tests.commands import run_command

SCENE, DELAY = "crazyflie_21", 0.02  # [s]
KEYS = (
    "effects.rotor_quadratic.thrust_constant",
    "airframe.motor.time_constant",
    "airframe.mass.inertia.0",
)
WRONG = (1.3, 0.7, 1.4)  # initial over true values


@pytest.fixture(scope="module")
def flights():
    """Return flights whose commands reach the motors late, without positions."""
    result = []
    for flight in simulated(PlantRows(SCENE, INTERVAL), 12.0, [1, 2, 3]):
        late = round(DELAY / INTERVAL)
        early = np.concatenate([flight.motor_voltage[late:], np.repeat(flight.motor_voltage[-1:], late, axis=0)])
        unknown = {name: np.full_like(getattr(flight, name), np.nan) for name in ("position", "velocity", "attitude")}
        result.append(replace(flight, motor_voltage=early, **unknown))
    return result


def write_blackbox(path: Path, flight):
    """Write a table as `blackbox_decode` does."""
    columns = {
        "time (us)": 1e6 * INTERVAL * np.arange(len(flight)),
        **{f"gyroADC[{k}]": np.degrees(flight.omega[:, k]) for k in range(3)},
        **{f"accSmooth[{k}]": flight.specific_force[:, k] / 9.80665 * 2048.0 for k in range(3)},
        **{f"motor[{k}]": 48.0 + 1999.0 * flight.motor_voltage[:, k] / BATTERY for k in range(4)},
        "vbatLatest (V)": flight.battery_voltage,
    }
    np.savetxt(path, np.column_stack(list(columns.values())), "%.6f", ",", header=",".join(columns), comments="")
    return path


def write_rates(folder: Path, flight, kind: str, attitude: bool = False):
    """Write a log without positions, by default also without an attitude."""
    path, level = folder / f"{flight.name}{kind}", np.tile([1.0, 0.0, 0.0, 0.0], (len(flight), 1))
    if kind == ".csv":
        return write_blackbox(path, flight)
    if kind == ".ulg":
        names = ("vehicle_local_position",) if attitude else ("vehicle_local_position", "vehicle_attitude")
        absent = [(name, 0, flight_writers.ULOG[name], "f", lambda k: None) for name in names]
        motion = flight if attitude else replace(flight, attitude=level)
        return flight_writers.write_ulog_topics(path, motion, absent)
    rows = [r for r in flight_writers.dataflash_rows(replace(flight, attitude=level)) if r[0] not in ("XKF1", "XKQ")]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(flight_writers, "dataflash_rows", lambda flight: iter(rows))
        flight_writers.write_bin(path, flight)
    return path


@pytest.mark.parametrize("kind", [".csv", ".ulg", ".bin"])
def test_log_without_positions_is_read(flights, tmp_path, kind):
    result = open_flight(write_rates(tmp_path, flights[0], kind), "betaflight")
    n = len(result)
    assert result.valid.all()
    assert result.missing == ["position", "velocity", "attitude"]
    assert result.omega == pytest.approx(flights[0].omega[:n], abs=1e-5)
    assert result.motor_voltage == pytest.approx(flights[0].motor_voltage[:n], abs=5e-3)
    assert "no position, velocity, attitude: validate and identify use the other signals" in result.notes


def test_recording_without_positions_keeps_its_measured_values(flights):
    flight = replace(flights[0], motor_voltage=np.where(np.arange(1200)[:, None] < 100, 0.3, flights[0].motor_voltage))
    missing = unmeasured_motion([flight])
    made_up = with_made_up_motion(flight, missing)
    assert missing == ("position", "velocity", "attitude")
    assert unmeasured_motion([flight, made_up]) == ()
    assert np.array_equal(made_up.omega, flight.omega)
    assert not made_up.valid[:100].any()  # idle motors: it may stand on the ground
    assert made_up.valid[100:].mean() > 0.9
    assert np.abs(np.linalg.norm(made_up.attitude, axis=1) - 1.0).max() < 1e-9


def test_motion_in_the_world_needs_an_attitude(flights):
    flight, level = flights[0], np.tile([1.0, 0.0, 0.0, 0.0], (len(flights[0]), 1))
    moving = np.zeros((len(flight), 3))
    assert unmeasured_motion([replace(flight, attitude=level)]) == ("position", "velocity")
    assert unmeasured_motion([replace(flight, attitude=level, velocity=moving)]) == ("position",)
    assert len(unmeasured_motion([replace(flight, position=moving, velocity=moving)])) == 3


def test_accelerometer_gives_thrust_over_mass(flights):
    missing = unmeasured_motion(flights)
    assert "only thrust over mass" in unknown_parameters(flights, missing)[0]
    deaf = [replace(f, specific_force=np.full_like(f.specific_force, np.nan)) for f in flights]
    assert "there is no accelerometer" in unknown_parameters(deaf, missing)[0]
    assert not any("drag" in line for line in unknown_parameters(flights, ("position",)))


@pytest.mark.long
def test_command_judges_rates_and_attitude_without_positions(flights, tmp_path):
    path = write_rates(tmp_path, flights[0], ".bin")
    done = run_command("validate", SCENE, path, "--json", tmp_path / "v.json", "--report", tmp_path / "v.html", code=0)
    assert "not in the logs, thus made up and not compared: position, velocity, attitude" in done.stdout
    content = json.loads((tmp_path / "v.json").read_text())
    assert {row["signal"] for row in content["verdict"]["comparisons"]} == {"rate", "specific_force", "power"}
    assert content["flights"]["seed1"]["thrust_ratio"] == pytest.approx(1.0, abs=0.05)
    assert content["warnings"] == []
    logs = simulated(PlantRows(SCENE, INTERVAL), 12.0, [4])
    done = run_command(
        "validate", SCENE, write_rates(tmp_path, logs[0], ".ulg", attitude=True), "--json", tmp_path / "v.json", code=0
    )
    content = json.loads((tmp_path / "v.json").read_text())
    assert content["missing"] == ["position", "velocity"]
    uses = content["verdict"]["uses"]
    assert uses["position loops"] is None
    assert "worse" not in uses.values()


@pytest.mark.long
def test_command_estimates_thrust_lag_inertia_and_delay_without_positions(flights, tmp_path):
    kinds = (".csv", ".ulg", ".bin")
    paths = [write_rates(tmp_path, flight, kind) for flight, kind in zip(flights, kinds, strict=True)]
    true = [start_value(load_one(SCENE, ()), key) for key in KEYS]
    inertia = [start_value(load_one(SCENE, ()), f"airframe.mass.inertia.{k}") for k in range(3)]
    inertia[0] *= WRONG[2]
    wrong = (
        f"{KEYS[0]}={WRONG[0] * true[0]}", f"{KEYS[1]}={WRONG[1] * true[1]}", f"airframe.mass.inertia={inertia}",
    )  # fmt: skip
    done = run_command(
        "identify", SCENE, *paths, "--mapping", "betaflight", "--out", tmp_path / "mine.toml", "--windows", "150",
        "--json", tmp_path / "mine.json", "--free", ",".join((*KEYS, "flight.command_delay")),
        *(part for text in wrong for part in ("--set", text)), code=0)  # fmt: skip
    assert "not known without positions: mass: only thrust over mass" in done.stdout
    content = json.loads((tmp_path / "mine.json").read_text())
    estimates = {key: entry["estimate"] for key, entry in content["parameters"].items()}
    assert estimates[KEYS[0]] == pytest.approx(true[0], rel=0.02)
    assert estimates[KEYS[1]] == pytest.approx(true[1], rel=0.1)  # initially 30 % wrong
    assert estimates[KEYS[2]] == pytest.approx(true[2], rel=0.1)  # initially 40 % wrong
    assert estimates["flight.command_delay"] == pytest.approx(DELAY, rel=0.15)
    assert estimates[KEYS[1]] + estimates["flight.command_delay"] == pytest.approx(true[1] + DELAY, rel=0.05)
    assert content["posterior"]["keys"] == list(KEYS)
    uses = content["verdict"]["uses"]
    assert [name for name, outcome in uses.items() if outcome is None] == ["position loops", "attitude loops"]
    assert {row["signal"] for row in content["verdict"]["comparisons"]} == {"rate", "specific_force"}
