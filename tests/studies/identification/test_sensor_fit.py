"""Estimation of known sensor parameters from simulated flights."""

import tomllib
from dataclasses import replace

import numpy as np
import pytest
from flight_recordings import INTERVAL as FLIGHT_INTERVAL
from flight_recordings import simulated, write_csv

from lapwing.dynamics.geodesy import Home, enu_to_geodetic
from lapwing.flights.log_import.recording import Recording, Series
from lapwing.studies.identification.sensor_fit import fit_all, fit_sensors
from lapwing.studies.validation.plant_rows import PlantRows
from tests.commands import run_command

INTERVAL, SECONDS = 0.01, 300.0


@pytest.fixture(scope="module")
def flight():
    """Return a flight with 150 s at rest, then circles, and random sensor errors."""
    draw = np.random.default_rng(1)
    t = INTERVAL * np.arange(round(SECONDS / INTERVAL))
    moving = np.clip((t - 150.0) / 5.0, 0.0, 1.0)
    position = np.column_stack([5.0 * np.sin(t) * moving, 5.0 * np.cos(t) * moving, 3.0 * moving])
    roll = 0.3 * np.sin(3.0 * t) * moving
    attitude = np.column_stack([np.cos(roll / 2), np.sin(roll / 2), 0 * t, 0 * t])
    fine = 0.004 * np.arange(round(SECONDS / 0.004))
    rate = np.gradient(np.interp(fine - 0.012, t, roll), 0.004)
    imu = np.column_stack([rate, 0 * fine, 0 * fine, 0 * fine, 0 * fine, 9.80665 + 0 * fine])
    imu += draw.standard_normal(imu.shape) * ([1e-3] * 3 + [2e-2] * 3) + [2e-3, 0, 0, 0, 0, 0]
    slow = 0.1 * np.arange(round(SECONDS / 0.1))
    home = Home()
    late = np.column_stack([np.interp(slow - 0.2, t, c) for c in position.T]) + 0.02 * draw.standard_normal(
        (len(slow), 3)
    )
    gps = np.array([enu_to_geodetic(home, tuple(row)) for row in late.tolist()])
    mid = 0.02 * np.arange(round(SECONDS / 0.02))
    baro = 98000.0 - 11.8 * np.interp(mid, t, position[:, 2]) + 1.5 * draw.standard_normal(len(mid))
    volts = np.where(t < 150.0, 0.0, 3.0)[:, None] * np.ones(4)
    n = len(t)
    return Recording(
        "flight", INTERVAL, position, attitude, np.gradient(position, t, axis=0), np.zeros((n, 3)),
        np.full((n, 3), [0.0, 0.0, 9.80665]),
        volts, np.full(n, 4.0), np.ones(n, bool),
        readings={"imu": Series(fine, imu), "gps": Series(slow, gps), "baro": Series(mid, baro[:, None])},
    )  # fmt: skip


def test_noise_bias_and_latency_return(flight):
    result, _ = fit_sensors(flight)
    imu = result["imu"]
    assert imu["rate"] == 250.0
    assert np.radians(imu["gyro"]["noise_dps_per_sqrt_hz"]) * np.sqrt(125.0) == pytest.approx(1e-3, rel=0.05)
    assert imu["accelerometer"]["noise_mg_per_sqrt_hz"] * 9.80665e-3 * np.sqrt(125.0) == pytest.approx(2e-2, rel=0.05)
    assert np.radians(imu["gyro"]["turn_on_bias_dps"]) == pytest.approx(2e-3 / np.sqrt(3.0), rel=0.1)
    assert imu["latency_samples"] == 3
    assert result["gps"]["noise_horizontal_m_per_sqrt_hz"] * np.sqrt(5.0) == pytest.approx(0.02, rel=0.1)
    assert result["gps"]["latency_samples"] == 2
    assert result["gps"]["correlated_error_horizontal"] < 0.02
    assert result["barometer"]["noise_pa_per_sqrt_hz"] * 5.0 == pytest.approx(1.5, rel=0.05)


@pytest.mark.parametrize("moving", [{"specific_force": 0.0}, {"omega": 3.0}], ids=["falls", "turns over"])
def test_fall_without_motors_is_no_rest(flight, moving):
    columns = {name: np.full((len(flight), 3), value) for name, value in moving.items()}
    result, notes = fit_sensors(replace(flight, **columns))
    assert "turn_on_bias_dps" not in result["imu"]["gyro"]
    assert "turn_on_bias_mg" not in result["imu"]["accelerometer"]
    assert "no 2 s at rest" in notes[0]


@pytest.mark.long
def test_command_fits_imu_of_columns_as_of_imported_log(tmp_path):
    path = write_csv(tmp_path / "flight.csv", *simulated(PlantRows("crazyflie_21", FLIGHT_INTERVAL), 4.0, [1]))
    mapping = ("--mapping", "nanobench")
    commands = (
        ("identify", "crazyflie_21", path, *mapping, "--sensors", "--out", "columns.toml"),
        ("import", path, *mapping, "--out", "flight.mcap"),
        ("identify", "crazyflie_21", "flight.mcap", "--sensors", "--out", "log.toml"),
    )
    for command in commands:
        run_command(*command, code=0, folder=tmp_path)
    imus = [tomllib.loads((tmp_path / name).read_text())["sensors"]["imu"] for name in ("columns.toml", "log.toml")]
    assert imus[0]["gyro"] == pytest.approx(imus[1]["gyro"], rel=0.01)
    assert imus[0]["accelerometer"] == pytest.approx(imus[1]["accelerometer"], rel=0.01)


def test_remark_on_many_flights_is_printed_once(flight):
    short = [replace(flight, name=name, omega=np.full((len(flight), 3), 3.0)) for name in "ab"]
    assert [line for line in fit_all(short)[1] if "at rest with motors off" in line] == [
        "no 2 s at rest with motors off: noise is measured in flight, with vibration (2 flights)"
    ]
    assert all(line.endswith("(flight)") for line in fit_all([replace(flight, name="flight")])[1])


def test_white_noise_has_no_bias_instability(flight):
    result, _ = fit_sensors(flight)
    assert result["imu"]["gyro"]["bias_instability_deg_per_h"] == 0.0


@pytest.mark.long
def test_command_writes_tables_that_scene_takes(tmp_path):
    def run(*arguments):
        return run_command(*arguments, folder=tmp_path)

    scene = "delivery_mission"
    flights = run(
        "run", scene, "--mode", "single-process", "--log", "f.mcap", "--set", "run.duration=12", "--set",
        "success.require=[]",
    )  # fmt: skip
    assert flights.returncode == 0, flights.stderr
    done = run("identify", scene, "f.mcap", "--sensors", "--out", "sensors.toml")
    assert done.returncode == 0, done.stderr
    tables = tomllib.loads((tmp_path / "sensors.toml").read_text())["sensors"]
    assert tables["barometer"]["noise_pa_per_sqrt_hz"] == pytest.approx(0.3, rel=0.15)
    assert tables["imu"]["gyro"]["noise_dps_per_sqrt_hz"] == pytest.approx(0.30 * np.sqrt(2.0) / 60.0, rel=0.1)
    overrides = [f"sensors.{n}.{k}={v}" for n, t in tables.items() for k, v in t.items() if not isinstance(v, dict)]
    checked = run("check", scene, *[part for o in overrides for part in ("--set", o)])
    assert checked.returncode == 0, checked.stderr
    unused = ("--free", "airframe.mass.total", "--seed", "1", "--set", "run.duration=1")
    both = run("identify", scene, "f.mcap", "--sensors", *unused, "--out", "s.toml")
    assert both.returncode == 2
    assert "leave out --free, --seed, --set" in both.stderr
    assert not (tmp_path / "s.toml").exists()
