"""Coverage of the standard errors of `lapwing identify` on simulated flights with sensor noise.

`python -m benchmarks.identification_coverage [SEEDS [FIRST]]` flies SEEDS seeds from FIRST on, estimates four
parameters from each flight, and prints how many true values lie within two standard errors. Exact standard errors give
95 %.
"""

import sys
import time
from pathlib import Path

import numpy as np

from lapwing.services.scene_resolver import load_one
from lapwing.studies.identification.output_error import OutputError
from lapwing.studies.identification.procedure import start_value
from lapwing.studies.validation.plant_rows import PlantRows
from lapwing.studies.validation.start_states import NO_TRIM

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "studies"))
from flight_recordings import INTERVAL, simulated

SCENE, SECONDS, WINDOWS = "crazyflie_21", 20.0, 200
KEYS = (
    "effects.rotor_quadratic.thrust_constant",
    "airframe.motor.time_constant",
    "effects.h_force.coefficient",
    "airframe.mass.inertia.0",
)


def main(seeds: int = 100, first: int = 1) -> None:
    """Print coverage and mean error of each parameter."""
    begin = time.perf_counter()
    plant, rows = PlantRows(SCENE, INTERVAL), PlantRows(SCENE, INTERVAL)
    scene = load_one(SCENE, ())
    true = np.array([start_value(scene, key) for key in KEYS])
    deviations = []
    for flight in simulated(plant, SECONDS, list(range(first, first + seeds))):
        fit = OutputError(rows, [flight], KEYS, list(1.05 * true), WINDOWS, NO_TRIM).solve(most=20)
        deviations.append((fit.values - true) / fit.standard_errors)
    z = np.array(deviations)
    for key, column in zip(KEYS, z.T, strict=True):
        print(
            f"{key}: {np.mean(np.abs(column) < 2.0):.0%} within 2, mean {column.mean():+.2f}, spread {column.std():.2f}"
        )
    print(f"all: {np.mean(np.abs(z) < 2.0):.1%} of {z.size}, {time.perf_counter() - begin:.0f} s")


if __name__ == "__main__":
    main(*(int(argument) for argument in sys.argv[1:]))
