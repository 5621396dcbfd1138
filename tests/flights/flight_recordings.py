"""Recordings and CSV files of simulated flights, for the tests of validation and identification."""

import os
from pathlib import Path

import numpy as np
import pytest

from lapwing.flights.log_import.recording import Recording
from lapwing.flights.rotation_arrays import conjugate, from_vector, product, rotate, rotation_vector, unit
from lapwing.studies.validation.plant_rows import PlantRows

INTERVAL = 0.01  # [s]
NOISE = {"position": 2e-4, "velocity": 3e-3, "attitude": 2e-3, "omega": 1.5e-2}  # standard deviations, SI
FULL_SCALE, BATTERY = 65535.0, 4.3  # of the CSV files


def simulated(plant: PlantRows, seconds: float, seeds: list[int], noise: float = 1.0) -> list[Recording]:
    """Simulate flights in parallel with a simple attitude and height controller and random setpoints.

    Args:
        plant: plant with one parameter set.
        seconds: duration of the flights [s].
        seeds: seeds of setpoints and noise, one for each flight.
        noise: factor of the sensor noise.
    """
    n, ticks = len(seeds), round(seconds / INTERVAL)
    draws = [np.random.default_rng(seed) for seed in seeds]
    hold = 30  # duration of a setpoint [ticks]
    tilt = np.stack([d.uniform(-0.35, 0.35, (ticks // hold + 1, 3)) for d in draws])
    tilt[..., 2] *= 0.5
    blocks = plant.start(np.zeros(n, int))
    start = np.tile([0.0, 0.0, 3.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0], (n, 1))
    plant.write(blocks, slice(0, 13), start)
    layout = plant.example.parameters.layout
    rotors = np.array([layout.x_body, layout.y_body, layout.reaction_sign])
    constant = next(e.thrust_constant for e in plant.example.parameters.effects if hasattr(e, "thrust_constant"))
    hover = np.sqrt(plant.mass[0] * 9.80665 / (4 * constant)) / plant.speed_per_volt
    plant.write(blocks, slice(13, 13 + plant.rotors), np.full((n, plant.rotors), hover * plant.speed_per_volt))
    states, volts = np.empty((ticks, n, 13)), np.empty((ticks, n, plant.rotors))
    mixing = np.stack([np.sign(rotors[1]), -np.sign(rotors[0]), rotors[2]])
    for k in range(ticks):
        now = plant.read(blocks, slice(0, 13), n).copy()
        states[k] = now
        lean = rotation_vector(now[:, 3:7])
        moment = 1.2 * (tilt[:, k // hold] - lean) - 0.25 * now[:, 10:13]
        lift = 1.0 + 0.25 * (3.0 - now[:, 2]) - 0.25 * now[:, 9]
        share = lift[:, None] + 0.5 * moment @ mixing
        volts[k] = hover * np.sqrt(np.clip(share, 0.2, 1.8))
        plant.advance(blocks, volts[k])
    return [
        _recorded(f"seed{s}", states[:, i], volts[:, i], d, noise)
        for i, (s, d) in enumerate(zip(seeds, draws, strict=True))
    ]


def _recorded(name: str, states: np.ndarray, volts: np.ndarray, draw: np.random.Generator, noise: float) -> Recording:
    n = len(states)
    error = {key: noise * sigma * draw.standard_normal((n, 3)) for key, sigma in NOISE.items()}
    attitude = unit(product(states[:, 3:7], from_vector(error["attitude"])))
    change = np.gradient(states[:, 7:10], INTERVAL, axis=0) + np.array([0.0, 0.0, 9.80665])
    force = rotate(conjugate(states[:, 3:7]), change)
    return Recording(
        name, INTERVAL, states[:, :3] + error["position"], attitude, states[:, 7:10] + error["velocity"],
        states[:, 10:13] + error["omega"], force, volts, np.full(n, BATTERY), np.ones(n, bool),
    )  # fmt: skip


def write_csv(path: Path, flight: Recording) -> Path:
    """Write a CSV file with the columns of the mapping `nanobench`."""
    w, x, y, z = flight.attitude.T
    columns = {
        "t": 1000.0 + flight.interval * np.arange(len(flight)),
        **dict(zip(("px", "py", "pz"), flight.position.T, strict=True)),
        "qx": x, "qy": y, "qz": z, "qw": w,
        **dict(zip(("vx", "vy", "vz"), flight.velocity.T, strict=True)),
        **dict(zip(("imu_acc_x", "imu_acc_y", "imu_acc_z"), flight.specific_force.T / 9.80665, strict=True)),
        **dict(zip(("imu_gyro_x", "imu_gyro_y", "imu_gyro_z"), flight.omega.T, strict=True)),
        **{f"motor_motor_m{k + 1}": FULL_SCALE * v / BATTERY for k, v in enumerate(flight.motor_voltage.T)},
        "pwr_pm_vbat": flight.battery_voltage,
    }  # fmt: skip
    np.savetxt(path, np.column_stack(list(columns.values())), "%.9f", ",", header=",".join(columns), comments="")
    return path


def real_flights(folder: str) -> Path:
    """Return the folder of recorded flights, or skip the test."""
    base = Path(os.environ.get("LAPWING_FLIGHTS", Path(__file__).parents[3] / "shared" / "data"))
    if not (base / folder).is_dir():
        pytest.skip(f"no recorded flights at {base / folder}; set LAPWING_FLIGHTS")
    return base / folder
