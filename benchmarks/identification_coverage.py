"""Coverage of the standard errors of `lapwing identify` on simulated flights with sensor noise.

    python -m benchmarks.identification_coverage [--seeds N] [--first SEED] [--linear]

Flies N seeds, estimates four parameters from each flight, and prints how many true values lie within two standard
errors. Exact standard errors give 95 %. With `--linear` the moment equations are linearised about the true values and
then solved, in a twentieth of the time.
"""

import sys
import time
from pathlib import Path

import numpy as np

from lapwing.flights.log_import.recording import Recording
from lapwing.services.scene_resolver import load_one
from lapwing.studies.identification.instrumental_variables import moments
from lapwing.studies.identification.output_error import INSTRUMENT, OutputError
from lapwing.studies.identification.procedure import start_value
from lapwing.studies.validation.plant_rows import PlantRows
from lapwing.studies.validation.start_states import NO_TRIM

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "flights"))
from flight_recordings import INTERVAL, simulated

from benchmarks._command import command_line

SCENE, SECONDS, WINDOWS = "crazyflie_21", 20.0, 200
TOGETHER = 25  # flights per linearised problem
STEPS = 8  # to the solution of the linearised equations
KEYS = (
    "effects.rotor_quadratic.thrust_constant",
    "airframe.motor.time_constant",
    "effects.h_force.coefficient",
    "airframe.mass.inertia.0",
)


def complete(rows: PlantRows, flight: Recording, true: np.ndarray) -> np.ndarray:
    """Return the errors of the estimated parameters in standard errors."""
    fit = OutputError(rows, [flight], KEYS, list(1.05 * true), WINDOWS, NO_TRIM).solve(most=20)
    return (fit.values - true) / fit.standard_errors


def linearised(rows: PlantRows, flights: list[Recording], true: np.ndarray) -> list[np.ndarray]:
    """Return the errors of the solution of each flight's linearised moment equations, in standard errors there."""
    problem = OutputError(rows, flights, KEYS, list(1.05 * true), WINDOWS * len(flights), NO_TRIM)
    x = true / problem.scale
    residual, derivatives = problem.derivatives(x)
    instruments, clusters = problem.derivatives(x, INSTRUMENT)[1], problem.clusters()
    edges = np.cumsum([len(window.starts) for window in problem.windows])[:-1]
    rows_of_window = len(residual) // len(clusters)
    parts = (np.split(values, edges * rows_of_window) for values in (residual, derivatives, instruments))
    return [solution(*part, names) for *part, names in zip(*parts, np.split(clusters, edges), strict=True)]


def solution(
    residual: np.ndarray, derivatives: np.ndarray, instruments: np.ndarray, clusters: np.ndarray
) -> np.ndarray:
    """Return the solution of linear moment equations in standard errors. See `moments` for arguments."""
    x = np.zeros(derivatives.shape[1])
    for _ in range(STEPS):
        result = moments(residual + derivatives @ x, derivatives, instruments, clusters - clusters[0])
        x = x + result.step
    return x / result.deviation


def main(seeds: int = 100, first: int = 1, linear: bool = False) -> None:
    begin = time.perf_counter()
    plant, rows = PlantRows(SCENE, INTERVAL), PlantRows(SCENE, INTERVAL)
    scene = load_one(SCENE, ())
    true = np.array([start_value(scene, key) for key in KEYS])
    flights = simulated(plant, SECONDS, list(range(first, first + seeds)))
    if linear:
        groups = [flights[k : k + TOGETHER] for k in range(0, seeds, TOGETHER)]
        z = np.array([row for group in groups for row in linearised(rows, group, true)])
    else:
        z = np.array([complete(rows, flight, true) for flight in flights])
    for key, column in zip(KEYS, z.T, strict=True):
        within = 100.0 * np.mean(np.abs(column) < 2.0)
        print(f"{key}: {within:.0f} % within 2, mean {column.mean():+.2f}, spread {column.std():.2f}")
    print(f"all: {100.0 * np.mean(np.abs(z) < 2.0):.1f} % of {z.size}, {time.perf_counter() - begin:.0f} s")


if __name__ == "__main__":
    command_line(main)
