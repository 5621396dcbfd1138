"""Causes of the errors of attitude and rate after 0.5 s.

    python -m benchmarks.validation_information SCENE MAPPING FLIGHTS...

Fits regressions to all flights except one, predicts that one, and prints the mean absolute rate error and the mean
angle of the attitude error by the inputs of the regression: nothing, the start state, commands before the window, and
commands up to some time in the window. The first two figures are of regressions for the motion itself, without physics,
the others of regressions for the errors of the scene's plant: what an input explains is missing in the model.
"""

from pathlib import Path

import numpy as np

from benchmarks._command import command_line
from lapwing.flights.log_import.open_flight import open_flight
from lapwing.studies.validation.linear_baseline import RIDGE, SLICE, _regressors, _targets
from lapwing.studies.validation.procedure import compare_with_flights, plant_of, with_windows
from lapwing.studies.validation.start_states import USUAL_TRIM

LONGEST, STATES, PAST = 50, 9, 2  # samples of a window; columns of the state; slices of commands before it
STRIDE = 10  # samples between the starts of two windows


def main(scene: str, mapping: str, flights: list[Path]) -> None:
    recordings, _ = with_windows([open_flight(path, mapping) for path in flights], LONGEST)
    plant = plant_of(scene, recordings)
    result = compare_with_flights(scene, plant, recordings, (LONGEST,), USUAL_TRIM, STRIDE).flights
    regressors = [_regressors(f.recording, f.starts, LONGEST) for f in result]
    motion = [_targets(f.recording, f.starts, (LONGEST,))[:, 6:] for f in result]
    errors = [np.column_stack([f.plant.attitude[:, 0], f.plant.rate[:, 0]]) for f in result]
    desired = [np.column_stack(pair) for pair in zip(motion, errors, strict=True)]
    rotors = plant.rotors
    inputs = {"nothing": np.r_[-1], "start state": np.r_[:STATES, -1]}
    names = {"commands before the window, too": PAST}
    names |= {f"commands of the first {k * SLICE} samples, too": PAST + k for k in (5, 7, LONGEST // SLICE)}
    inputs |= {name: np.r_[: STATES + rotors * slices, -1] for name, slices in names.items()}
    for name, chosen in inputs.items():
        error = np.concatenate([_left_out(regressors, desired, chosen, k) for k in range(len(desired))])
        figures = [
            f"rate {np.abs(error[:, first + 3 : first + 6]).mean():.4f} rad/s, "
            f"attitude {np.linalg.norm(error[:, first : first + 3], axis=1).mean():.4f} rad"
            for first in (0, 6)
        ]
        print(f"{name}: {figures[0]}; errors of the plant: {figures[1]}", flush=True)


def _left_out(regressors: list[np.ndarray], desired: list[np.ndarray], chosen: np.ndarray, k: int) -> np.ndarray:
    """Return the errors of the prediction of flight k by a fit to the others, shape (n, 12)."""
    x = np.concatenate([r[:, chosen] for j, r in enumerate(regressors) if j != k])
    y = np.concatenate([t for j, t in enumerate(desired) if j != k])
    scale = np.maximum(x.std(axis=0), 1e-6)
    x, scale[-1] = x / np.r_[scale[:-1], 1.0], 1.0
    gain = np.linalg.solve(x.T @ x + RIDGE * len(x) * np.eye(x.shape[1]), x.T @ y)
    return desired[k] - regressors[k][:, chosen] / scale @ gain


if __name__ == "__main__":
    command_line(main)
